#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "active_matching_slam/matching/pixel_mask.h"

namespace active_matching_slam {

/// The region { p : (p - center)^T covariance^-1 (p - center) <= 9 } (closed): the 3-sigma ellipse.
struct SearchEllipse {
  Eigen::Vector2d center;      ///< [px]
  Eigen::Matrix2d covariance;  ///< [px^2]
};

/// One response of the image to a feature's template.
struct SearchMatch {
  Eigen::Vector2d pixel;  ///< sub-pixel position [px]
  double score = 0.0;     ///< similarity, for images ZNCC in [-1, 1]
  int id = -1;            ///< stable within the feature; searches list matches by ascending id
  double sigma_px = 0.0;  ///< per axis, estimated from the image; 0: unknown
  /// Spurious matches that such a search brings, over those that correlating every pixel would.
  double clutter = 1.0;
  /// Covariance of its error, normalised to trace 2 (mean variance of an axis 1).
  Eigen::Matrix2d noise_shape = Eigen::Matrix2d::Identity();
};

/// Result of one search.
struct SearchOutcome {
  std::vector<int> matches;   ///< indices into FeatureSearch::matches(feature), ascending by id
  int pixels_in_ellipse = 0;  ///< integer pixel centres in the ellipse and in the valid area
  int pixels_new = 0;  ///< of these (and of their neighbours, if looked at), never searched before
  int correlations = 0;  ///< that it took: what the search cost [px]
};

/// Axis-aligned box of pixel centres, closed: the positions at which a feature can be searched.
struct PixelBox {
  int min_u = std::numeric_limits<int>::min(), min_v = std::numeric_limits<int>::min();
  int max_u = std::numeric_limits<int>::max(), max_v = std::numeric_limits<int>::max();
  bool isUnbounded() const { return max_u == std::numeric_limits<int>::max(); }
};

/// Answers "where in this ellipse does feature i match?" for one frame. It remembers, per feature,
/// which pixels were searched and what was found, so no pixel is searched or counted twice.
/// Features are indices into the MeasurementPrior. The image implements it with templates and score
/// maps, tests with lists of points.
class FeatureSearch {
 public:
  virtual ~FeatureSearch() = default;

  virtual int featureCount() const = 0;

  /// Searches the 3-sigma ellipse, clipped to validArea(). A covariance that is not finite or not
  /// positive definite, or an ellipse outside the valid area, brings an empty outcome.
  virtual SearchOutcome search(int feature, const SearchEllipse& ellipse) = 0;

  /// Number of integer pixel centres of the ellipse inside the valid area that no search of the
  /// feature has looked at yet. Searches nothing.
  virtual int countNewPixels(int feature, const SearchEllipse& ellipse) const = 0;

  /// Correlations that a search of so many pixels, none of them searched before, will take about.
  virtual double expectedCost(int feature, double area_px) const {
    (void)feature;
    return area_px;
  }

  /// Every match of the feature found so far in this frame, by any ellipse, in order of discovery.
  virtual const std::vector<SearchMatch>& matches(int feature) const = 0;

  /// Every pixel searched so far for the feature in this frame.
  virtual const PixelMask& searchedPixels(int feature) const = 0;

  virtual PixelBox validArea(int feature) const = 0;
};

}  // namespace active_matching_slam
