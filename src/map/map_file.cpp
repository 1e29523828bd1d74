#include "active_matching_slam/map/map_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>

namespace active_matching_slam {
namespace {

/// A covariance of 1800 inverse-depth features.
constexpr std::int64_t kMaximumFileSize = 512ll << 20;

[[noreturn]] void failedTo(const std::string& action, const std::string& path,
                           const std::string& cause) {
  throw std::runtime_error("can't " + action + " map " + path + ": " + cause);
}

std::string systemError() { return std::strerror(errno); }

/// Closes on the way out.
class Descriptor {
 public:
  explicit Descriptor(int value) : value_(value) {}
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return value_; }
  bool close() {
    const int value = value_;
    value_ = -1;
    return ::close(value) == 0;
  }

 private:
  int value_;
};

bool writeAll(int file, const std::string& bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::write(file, bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    done += static_cast<std::size_t>(count);
  }
  return true;
}

std::string folderOf(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

}  // namespace

void writeMapFile(const std::string& path, const MapFileContent& content) {
  std::string bytes;
  try {
    bytes = serializeMap(content);
  } catch (const std::invalid_argument& error) {
    failedTo("write", path, error.what());
  }
  if (static_cast<std::int64_t>(bytes.size()) > kMaximumFileSize)
    failedTo("write", path, std::to_string(bytes.size()) + " bytes are more than a map may have");

  std::string temporary = path + ".XXXXXX";
  Descriptor file(::mkostemp(temporary.data(), O_CLOEXEC));
  if (file.get() < 0) failedTo("write", path, systemError());
  const bool written = writeAll(file.get(), bytes) && ::fchmod(file.get(), 0644) == 0 &&
                       ::fsync(file.get()) == 0 && file.close() &&
                       ::rename(temporary.c_str(), path.c_str()) == 0;
  if (!written) {
    const std::string cause = systemError();
    ::unlink(temporary.c_str());
    failedTo("write", path, cause);
  }
  // Makes the new name last, too; where folders can't be synchronised, nothing is lost.
  const Descriptor folder(::open(folderOf(path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder.get() >= 0) ::fsync(folder.get());
}

MapFileContent readMapFile(const std::string& path) {
  // Without O_NONBLOCK, opening a pipe would wait for a writer.
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  if (file.get() < 0) failedTo("read", path, systemError());
  struct stat status;
  if (::fstat(file.get(), &status) != 0) failedTo("read", path, systemError());
  if (!S_ISREG(status.st_mode)) failedTo("read", path, "it is not a file");
  if (status.st_size > kMaximumFileSize)
    failedTo("read", path, std::to_string(status.st_size) + " bytes are more than a map may have");

  std::string bytes(static_cast<std::size_t>(status.st_size), '\0');
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::read(file.get(), &bytes[done], bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) failedTo("read", path, systemError());
    if (count == 0) break;
    done += static_cast<std::size_t>(count);
  }
  bytes.resize(done);
  try {
    return parseMap(bytes);
  } catch (const std::runtime_error& error) {
    failedTo("read", path, error.what());
  }
}

}  // namespace active_matching_slam
