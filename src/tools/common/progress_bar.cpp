#include "progress_bar.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace active_matching_slam {

ProgressBar::ProgressBar(const std::string& name, int total)
    : name_(name), total_(std::max(1, total)), terminal_(isatty(STDERR_FILENO) != 0) {}

ProgressBar::~ProgressBar() {
  if (terminal_ && shown_ >= 0) std::fputc('\n', stderr);
}

void ProgressBar::advance(int done, const std::string& note) {
  const int steps = terminal_ ? 200 : 10;
  const int step = std::min(steps, static_cast<int>(static_cast<long long>(done) * steps / total_));
  if (step == shown_) return;
  shown_ = step;
  if (!terminal_) {
    std::fprintf(stderr, "%s: %d of %d, %s\n", name_.c_str(), done, total_, note.c_str());
    return;
  }
  const int width = 32, filled = step * width / steps;
  const std::string bar = std::string(filled, '=') + std::string(width - filled, ' ');
  std::fprintf(stderr, "\r%s [%s] %d/%d  %s\033[K", name_.c_str(), bar.c_str(), done, total_,
               note.c_str());
  std::fflush(stderr);
}

}  // namespace active_matching_slam
