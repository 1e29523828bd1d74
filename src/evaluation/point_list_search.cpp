#include "active_matching_slam/evaluation/point_list_search.h"

#include <stdexcept>
#include <string>
#include <utility>

#include "active_matching_slam/matching/search_ellipse.h"

namespace active_matching_slam {
namespace {

bool isInBox(const Eigen::Vector2d& p, const PixelBox& box) {
  return p.x() >= box.min_u - 0.5 && p.x() <= box.max_u + 0.5 && p.y() >= box.min_v - 0.5 &&
         p.y() <= box.max_v + 0.5;
}

}  // namespace

PointListSearch::PointListSearch(std::vector<std::vector<Eigen::Vector2d>> points,
                                 std::vector<std::vector<double>> scores, PixelBox valid)
    : features_(points.size()), valid_(valid) {
  if (!scores.empty() && scores.size() != points.size())
    throw std::invalid_argument("scores: " + std::to_string(scores.size()) + " lists, must be " +
                                std::to_string(points.size()));
  for (std::size_t f = 0; f < points.size(); ++f) {
    Feature& feature = features_[f];
    feature.points = std::move(points[f]);
    feature.index_of_point.assign(feature.points.size(), -1);
    if (scores.empty()) {
      feature.scores.assign(feature.points.size(), 0.0);
    } else if (scores[f].size() == feature.points.size()) {
      feature.scores = std::move(scores[f]);
    } else {
      throw std::invalid_argument("scores[" + std::to_string(f) +
                                  "]: " + std::to_string(scores[f].size()) + " entries, must be " +
                                  std::to_string(feature.points.size()));
    }
  }
}

SearchOutcome PointListSearch::search(int feature, const SearchEllipse& ellipse) {
  SearchOutcome outcome;
  if (!isProperEllipse(ellipse)) return outcome;
  Feature& f = features_[static_cast<std::size_t>(feature)];
  forEachEllipseRun(ellipse, valid_, [&](const PixelRun& run) {
    outcome.pixels_in_ellipse += run.end_u - run.begin_u;
    outcome.pixels_new += f.searched.insert(run);
  });
  outcome.correlations = outcome.pixels_new;
  for (std::size_t i = 0; i < f.points.size(); ++i) {
    if (!isInBox(f.points[i], valid_)) continue;
    if (!(mahalanobisSquared(ellipse, f.points[i]) <= kEllipseRadius2)) continue;
    if (f.index_of_point[i] < 0) {
      f.index_of_point[i] = static_cast<int>(f.found.size());
      f.found.push_back({f.points[i], f.scores[i], static_cast<int>(i)});
    }
    outcome.matches.push_back(f.index_of_point[i]);
  }
  return outcome;
}

int PointListSearch::countNewPixels(int feature, const SearchEllipse& ellipse) const {
  const PixelMask& searched = features_[static_cast<std::size_t>(feature)].searched;
  int fresh = 0;
  forEachEllipseRun(ellipse, valid_,
                    [&](const PixelRun& run) { fresh += searched.countMissing(run); });
  return fresh;
}

const std::vector<SearchMatch>& PointListSearch::matches(int feature) const {
  return features_[static_cast<std::size_t>(feature)].found;
}

const PixelMask& PointListSearch::searchedPixels(int feature) const {
  return features_[static_cast<std::size_t>(feature)].searched;
}

PixelBox PointListSearch::validArea(int) const { return valid_; }

void PointListSearch::reset() {
  for (Feature& feature : features_) {
    feature.index_of_point.assign(feature.points.size(), -1);
    feature.found.clear();
    feature.searched.clear();
  }
}

}  // namespace active_matching_slam
