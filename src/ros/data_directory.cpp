#include "active_matching_slam/ros/data_directory.h"

#include <algorithm>
#include <boost/filesystem.hpp>
#include <cctype>
#include <cstdlib>
#include <stdexcept>

namespace active_matching_slam {
namespace {

std::string rosHome() {
  if (const char* home = std::getenv("ROS_HOME"); home && *home) return home;
  if (const char* home = std::getenv("HOME"); home && *home) return std::string(home) + "/.ros";
  return ".";
}

bool isPlain(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '_' || c == '-';
}

}  // namespace

DataDirectory::DataDirectory(const std::string& path)
    : path_(path.empty() ? rosHome() + "/active_matching_slam" : path) {}

std::string DataDirectory::resolve(const std::string& file_name) const {
  const auto fail = [&](const std::string& what) {
    throw std::invalid_argument("file name '" + file_name + "' " + what);
  };
  if (file_name.empty()) fail("is empty");
  if (file_name.size() > 200) fail("is longer than 200 characters");
  if (file_name.front() == '.') fail("begins with a dot");
  if (!std::all_of(file_name.begin(), file_name.end(), isPlain))
    fail("holds more than letters, digits, '.', '_' and '-': give a name without a path");
  return (boost::filesystem::path(path_) / file_name).string();
}

void DataDirectory::create() const {
  boost::system::error_code error;
  boost::filesystem::create_directories(path_, error);
  if (error || !boost::filesystem::is_directory(path_))
    throw std::runtime_error("data_directory '" + path_ + "' can't be made: " + error.message());
}

}  // namespace active_matching_slam
