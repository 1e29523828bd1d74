#include "tool_main.h"

#include <boost/program_options/parsers.hpp>
#include <exception>
#include <iostream>
#include <stdexcept>

#include "active_matching_slam/math/blas_threads.h"

namespace active_matching_slam {

int runTool(const std::string& name, const std::function<int()>& run) {
  useSingleThreadedBlas();
  try {
    return run();
  } catch (const std::exception& error) {
    std::string line = error.what();
    for (char& c : line)
      if (c == '\n' || c == '\r') c = ' ';
    std::cerr << name << ": " << line << "\n";
    return kToolFault;
  }
}

boost::program_options::variables_map readArguments(
    int argc, const char* const* argv, const boost::program_options::options_description& options) {
  namespace po = boost::program_options;
  const po::parsed_options parsed = po::parse_command_line(argc, argv, options);
  for (const po::option& option : parsed.options)
    if (option.position_key >= 0)
      throw std::runtime_error("'" + option.value.front() + "' belongs to no option (see --help)");
  po::variables_map values;
  po::store(parsed, values);
  return values;
}

}  // namespace active_matching_slam
