#pragma once

#include <Eigen/Core>
#include <vector>

#include "active_matching_slam/matching/feature_search.h"

namespace active_matching_slam {

/// A FeatureSearch over known lists of points, for abstract matching problems (tests, golden
/// vectors, simulated experiments): what an image would answer, without an image.
class PointListSearch : public FeatureSearch {
 public:
  /// `points[f]`: all points at which feature f matches, anywhere [px]; `scores[f]` one a point (or
  /// empty: 0). The id of a match is its index in the list. `valid` is the area of every feature.
  /// Throws std::invalid_argument when the sizes disagree.
  explicit PointListSearch(std::vector<std::vector<Eigen::Vector2d>> points,
                           std::vector<std::vector<double>> scores = {}, PixelBox valid = {});

  int featureCount() const override { return static_cast<int>(features_.size()); }
  SearchOutcome search(int feature, const SearchEllipse& ellipse) override;
  int countNewPixels(int feature, const SearchEllipse& ellipse) const override;
  const std::vector<SearchMatch>& matches(int feature) const override;
  const PixelMask& searchedPixels(int feature) const override;
  PixelBox validArea(int feature) const override;

  /// Forgets every search.
  void reset();

 private:
  struct Feature {
    std::vector<Eigen::Vector2d> points;
    std::vector<double> scores;
    std::vector<int> index_of_point;  ///< into found, -1: not met yet
    std::vector<SearchMatch> found;
    PixelMask searched;
  };
  std::vector<Feature> features_;
  PixelBox valid_;
};

}  // namespace active_matching_slam
