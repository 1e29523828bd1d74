#include "tool_main.h"

#include <boost/program_options/parsers.hpp>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "active_matching_slam/math/blas_threads.h"
#include "active_matching_slam/math/freed_memory.h"

namespace active_matching_slam {
namespace {

/// Numbers are never options, however negative.
std::vector<boost::program_options::option> takeNumbers(std::vector<std::string>& arguments) {
  std::vector<boost::program_options::option> numbers;
  while (!arguments.empty()) {
    const std::string& text = arguments.front();
    char* end = nullptr;
    std::strtod(text.c_str(), &end);
    if (text.empty() || *end != '\0') break;
    boost::program_options::option number;
    number.position_key = static_cast<int>(numbers.size());
    number.value.push_back(text);
    number.original_tokens.push_back(text);
    numbers.push_back(number);
    arguments.erase(arguments.begin());
  }
  return numbers;
}

}  // namespace

int runTool(const std::string& name, const std::function<int()>& run) {
  useSingleThreadedBlas();
  keepFreedMemory();
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
  const po::parsed_options parsed =
      po::command_line_parser(argc, argv).options(options).extra_style_parser(takeNumbers).run();
  for (const po::option& option : parsed.options)
    if (option.position_key >= 0)
      throw std::runtime_error("'" + option.value.front() + "' belongs to no option (see --help)");
  po::variables_map values;
  po::store(parsed, values);
  return values;
}

}  // namespace active_matching_slam
