#include "active_matching_slam/math/chi_square.h"

#include <boost/math/distributions/chi_squared.hpp>

namespace active_matching_slam {

double chiSquareQuantile(double degrees, double probability) {
  return boost::math::quantile(boost::math::chi_squared(degrees), probability);
}

}  // namespace active_matching_slam
