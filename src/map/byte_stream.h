#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>

namespace active_matching_slam {

/// Numbers as little-endian bytes, doubles as they are.
class ByteWriter {
 public:
  void bytes(const void* data, std::size_t size) {
    out_.append(static_cast<const char*>(data), size);
  }
  template <typename Unsigned>
  void number(Unsigned value) {
    for (std::size_t i = 0; i < sizeof(value); ++i)
      out_.push_back(static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xff));
  }
  void integer(std::int64_t value) { number(static_cast<std::uint64_t>(value)); }
  void real(double value) {
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof(bits));
    number(bits);
  }
  template <typename Derived>
  void reals(const Eigen::MatrixBase<Derived>& values) {
    for (Eigen::Index j = 0; j < values.cols(); ++j)
      for (Eigen::Index i = 0; i < values.rows(); ++i) real(values(i, j));
  }
  const std::string& content() const { return out_; }

 private:
  std::string out_;
};

/// Reads what ByteWriter wrote; throws std::runtime_error with the cause for anything else.
class ByteReader {
 public:
  ByteReader(const std::string& bytes, std::size_t offset) : bytes_(bytes), offset_(offset) {}

  std::size_t remaining() const { return bytes_.size() - offset_; }
  const char* bytes(std::size_t size) {
    if (size > remaining()) throw std::runtime_error("it ends too early");
    offset_ += size;
    return bytes_.data() + (offset_ - size);
  }
  template <typename Unsigned>
  Unsigned number() {
    const char* data = bytes(sizeof(Unsigned));
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < sizeof(Unsigned); ++i)
      value |= static_cast<std::uint64_t>(static_cast<unsigned char>(data[i])) << (8 * i);
    return static_cast<Unsigned>(value);
  }
  std::int64_t integer() { return static_cast<std::int64_t>(number<std::uint64_t>()); }
  /// An integer within [low, high]; the error names it.
  std::int64_t integer(const char* name, std::int64_t low, std::int64_t high) {
    const std::int64_t value = integer();
    if (value < low || value > high)
      throw std::runtime_error(std::string(name) + " = " + std::to_string(value) + " is outside [" +
                               std::to_string(low) + ", " + std::to_string(high) + "]");
    return value;
  }
  int smallInteger(const char* name, int low, int high) {
    return static_cast<int>(integer(name, low, high));
  }
  double real() {
    const auto bits = number<std::uint64_t>();
    double value;
    std::memcpy(&value, &bits, sizeof(value));
    if (!std::isfinite(value)) throw std::runtime_error("it holds a number that is not finite");
    return value;
  }
  template <typename Derived>
  void reals(Eigen::MatrixBase<Derived>& values) {
    for (Eigen::Index j = 0; j < values.cols(); ++j)
      for (Eigen::Index i = 0; i < values.rows(); ++i) values(i, j) = real();
  }
  bool flag() { return smallInteger("flag", 0, 1) != 0; }

 private:
  const std::string& bytes_;
  std::size_t offset_;
};

}  // namespace active_matching_slam
