#pragma once

#include <string>

namespace active_matching_slam {

/// The one directory that services read from and write to.
class DataDirectory {
 public:
  /// Empty `path`: active_matching_slam in ROS's own directory ($ROS_HOME, or ~/.ros).
  explicit DataDirectory(const std::string& path);

  const std::string& path() const { return path_; }

  /// Path of a file in the directory. Throws std::invalid_argument, naming the fault, for a name
  /// that is empty, hidden, over 200 characters, or holds anything but letters, digits and "._-":
  /// so no name leads out of the directory.
  std::string resolve(const std::string& file_name) const;

  /// Makes the directory when there is none; throws std::runtime_error when that fails.
  void create() const;

 private:
  std::string path_;
};

}  // namespace active_matching_slam
