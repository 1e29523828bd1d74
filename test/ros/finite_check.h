#pragma once

#include <ros/serialization.h>

#include <boost/array.hpp>
#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

namespace active_matching_slam {

/// Goes through every field of a message, as a stream that is written to would.
class FiniteCheck {
 public:
  template <class T>
  void next(const T& value) {
    if constexpr (std::is_floating_point_v<T>)
      finite_ = finite_ && std::isfinite(value);
    else if constexpr (!std::is_arithmetic_v<T>)
      ros::serialization::Serializer<T>::template allInOne<FiniteCheck, const T&>(*this, value);
  }
  template <class T, class Allocator>
  void next(const std::vector<T, Allocator>& values) {
    if constexpr (!std::is_integral_v<T>)
      for (const T& value : values) next(value);
  }
  template <class T, std::size_t n>
  void next(const boost::array<T, n>& values) {
    for (const T& value : values) next(value);
  }
  void next(const std::string&) {}
  void next(const ros::Time&) {}
  void next(const ros::Duration&) {}

  bool finite() const { return finite_; }

 private:
  bool finite_ = true;
};

/// True when no floating-point number of the message is NaN or infinite, however deep it sits.
template <class Message>
bool isFiniteMessage(const Message& message) {
  FiniteCheck check;
  check.next(message);
  return check.finite();
}

}  // namespace active_matching_slam
