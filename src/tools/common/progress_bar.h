#pragma once

#include <string>

namespace active_matching_slam {

/// Progress on stderr: a bar on a terminal, else one line every tenth of the way. Shows nothing but
/// counts and a note, so it decides nothing.
class ProgressBar {
 public:
  ProgressBar(const std::string& name, int total);
  ~ProgressBar();  ///< ends the line of the bar
  void advance(int done, const std::string& note);

 private:
  std::string name_;
  int total_;
  bool terminal_;
  int shown_ = -1;  ///< last step drawn
};

}  // namespace active_matching_slam
