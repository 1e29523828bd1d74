#pragma once

#include <boost/program_options/options_description.hpp>
#include <boost/program_options/variables_map.hpp>
#include <functional>
#include <string>

namespace active_matching_slam {

constexpr int kToolFault = 2;  ///< exit status

/// What `run` returns; kToolFault where it throws, and one line on stderr that names tool and
/// fault.
int runTool(const std::string& name, const std::function<int()>& run);

/// What the command line says, as boost::program_options::parse_command_line() reads it. Throws for
/// what it throws for, and std::runtime_error for a word that belongs to no option.
boost::program_options::variables_map readArguments(
    int argc, const char* const* argv, const boost::program_options::options_description& options);

}  // namespace active_matching_slam
