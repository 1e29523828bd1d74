#include "active_matching_slam/evaluation/text_file.h"

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iomanip>
#include <limits>
#include <locale>
#include <sstream>
#include <stdexcept>

namespace active_matching_slam {

void writeTextFile(const std::string& path, const std::string& content) {
  errno = 0;
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  if (file) {
    file.write(content.data(), static_cast<std::streamsize>(content.size()));
    file.close();  // sets the fail bit when the last of the buffer can't be written
  }
  if (!file) {
    const std::string cause = errno != 0 ? std::string(": ") + std::strerror(errno) : "";
    throw std::runtime_error(path + ": cannot be written" + cause);
  }
}

std::string numberText(double value) {
  if (std::isnan(value)) return "nan";  // without its meaningless sign
  for (int digits = 15;; ++digits) {
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text << std::setprecision(digits) << value;
    if (digits == std::numeric_limits<double>::max_digits10) return text.str();
    std::istringstream back(text.str());
    back.imbue(std::locale::classic());
    double read = 0.0;
    if (back >> read && read == value) return text.str();
  }
}

}  // namespace active_matching_slam
