#pragma once

#include <sys/wait.h>

#include <cstdio>
#include <string>

namespace active_matching_slam {

struct ProgramOutcome {
  int status = -1;
  std::string output;  ///< stdout and stderr
};

/// Runs a program with arguments as a shell reads them, to its end.
inline ProgramOutcome runProgram(const std::string& program, const std::string& arguments) {
  ProgramOutcome outcome;
  FILE* pipe = popen((program + " " + arguments + " 2>&1").c_str(), "r");
  char buffer[256];
  while (pipe && std::fgets(buffer, sizeof buffer, pipe)) outcome.output += buffer;
  outcome.status = WEXITSTATUS(pclose(pipe));
  return outcome;
}

}  // namespace active_matching_slam
