#include <algorithm>
#include <cmath>
#include <tuple>

#include "active_matching_slam/image/image_feature_search.h"
#include "active_matching_slam/matching/search_ellipse.h"

namespace active_matching_slam {
namespace {

/// Pixels from which on a search is coarse to fine, and about how many it has on its coarsest
/// level. Cost: at fewer, what is found there takes as long to be looked at again as it saves.
constexpr double kWidePx = 4000.0, kCoarsePx = 1000.0;
/// Score on a coarse level from which on the level below is searched. Derivation: of a hundred true
/// places of recorded images all but one score more there.
constexpr float kLeastCoarseScore = 0.5f;
/// Places of the coarsest level that are looked at again, best first. Cost: about as many
/// correlations as the coarsest level itself has; of a hundred true places all but one are among
/// the best twenty.
constexpr std::size_t kPlaces = 32;
/// How far around a place of the level above is searched [px]. Derivation: half a pixel of that
/// level, for where its maximum lies between pixels, and another, for how far noise moves it.
constexpr int kReach = 2;
/// The same on the image itself, with the rim that a maximum needs.
constexpr int kFineReach = kReach + 1;
/// Pixels of each of these windows.
constexpr int kWindowPx = (2 * kReach + 1) * (2 * kReach + 1);
constexpr int kFineWindowPx = (2 * kFineReach + 1) * (2 * kFineReach + 1);
/// How often such a window follows its best pixel to beyond the rim.
constexpr int kMoves = 2;
/// Spurious matches that a search from this level on brings, over those of one that correlates
/// every pixel. Derivation: measured on recorded images, see doc/theory/active_matching.md.
constexpr double kClutter[] = {1.0, 0.47, 0.25};

int levelOf(double pixels, int coarsest) {
  return std::clamp(static_cast<int>(std::lround(0.5 * std::log2(pixels / kCoarsePx))), 1,
                    coarsest);
}

}  // namespace

double ImageFeatureSearch::expectedCost(int feature, double area_px) const {
  if (!(area_px > kWidePx) || static_cast<std::size_t>(feature) >= sources_.size()) return area_px;
  const int level = levelOf(area_px, kCoarsestLevel);
  return std::ldexp(area_px, -2 * level) +
         static_cast<double>(kPlaces) * (kWindowPx * (level - 1) + kFineWindowPx);
}

double ImageFeatureSearch::clutterPixels(int feature) const {
  const Feature& known = features_[static_cast<std::size_t>(feature)];
  return static_cast<double>(searchedPixels(feature).size()) - known.coarse_pixels +
         known.coarse_clutter_pixels;
}

/// Level on which the search of an ellipse begins; 0: its pixels are correlated one by one.
int ImageFeatureSearch::coarseLevel(int feature, const SearchEllipse& ellipse,
                                    int pixels_in_ellipse) {
  if (!(pixels_in_ellipse > kWidePx) || static_cast<std::size_t>(feature) >= sources_.size())
    return 0;
  const int pixels_new = countNewPixels(feature, ellipse);
  if (!(pixels_new > kWidePx)) return 0;
  const int wanted = levelOf(pixels_new, kCoarsestLevel);
  int level = 0;
  while (level < wanted && hasCoarseTemplate(feature, level + 1)) ++level;
  return level;
}

bool ImageFeatureSearch::hasCoarseTemplate(int feature, int level) {
  Feature& known = features_[static_cast<std::size_t>(feature)];
  CoarseLevel& coarse = known.coarse[static_cast<std::size_t>(level - 1)];
  if (!coarse.is_made) {
    coarse.is_made = true;
    const TemplateSource& source = sources_[static_cast<std::size_t>(feature)];
    if (!warpCoarseTemplate(source, level, known.patch.size, &coarse.patch) ||
        coarse.patch.contrast() < options_.minimum_contrast)
      coarse.patch.size = 0;
  }
  return coarse.patch.size > 0;
}

void ImageFeatureSearch::searchCoarseToFine(Feature& feature, const SearchEllipse& ellipse,
                                            const PixelBox& valid, int level) {
  if (!feature.is_wide) {
    feature.covered = feature.searched;
    feature.is_wide = true;
  }
  int covered = 0;
  forEachEllipseRun(ellipse, valid, [&](const PixelRun& run) {
    forEachUnmasked(run, [&](const PixelRun& part) { covered += feature.covered.insert(part); });
  });
  const double clutter = kClutter[level];
  feature.coarse_pixels += covered;
  feature.coarse_clutter_pixels += clutter * covered;
  std::vector<Candidate> places = coarseMaxima(feature, ellipse, valid, level);
  for (int finer = level - 1; finer > 0; --finer) {
    const cv::Mat& image = pyramid_.bordered(finer);
    const Template& patch = feature.coarse[static_cast<std::size_t>(finer - 1)].patch;
    for (Candidate& place : places)
      place = bestAround(image, patch, 2 * place.u, 2 * place.v, kReach);
    places.erase(std::remove_if(places.begin(), places.end(),
                                [](const Candidate& c) { return c.score < kLeastCoarseScore; }),
                 places.end());
  }
  for (const Candidate& place : places)
    addPeakNear(feature, {2 * place.u, 2 * place.v, 0.0f}, valid, clutter);
}

/// The best local maxima of the score on a level, in pixels of that level.
std::vector<ImageFeatureSearch::Candidate> ImageFeatureSearch::coarseMaxima(
    Feature& feature, const SearchEllipse& ellipse, const PixelBox& valid, int level) {
  constexpr int kBorder = ImagePyramid::kBorder;
  CoarseLevel& coarse = feature.coarse[static_cast<std::size_t>(level - 1)];
  const double scale = std::ldexp(1.0, -level);
  // Half a pixel wider, so that what lies between pixels of the level is met.
  const double margin = 0.25 / kEllipseRadius2;
  const SearchEllipse scaled{
      scale * ellipse.center + Eigen::Vector2d::Constant(kBorder),
      scale * scale * ellipse.covariance + margin * Eigen::Matrix2d::Identity()};
  const auto low = [&](int at) { return static_cast<int>(std::floor(scale * at)) + kBorder; };
  const auto high = [&](int at) { return static_cast<int>(std::ceil(scale * at)) + kBorder; };
  const cv::Mat& image = pyramid_.bordered(level);
  const PixelBox box{low(valid.min_u), low(valid.min_v),
                     std::min(high(valid.max_u), image.cols - 1 - kBorder),
                     std::min(high(valid.max_v), image.rows - 1 - kBorder)};
  added_.clear();
  forEachEllipseRun(scaled, box,
                    [&](const PixelRun& run) { coarse.searched.insert(run, &added_); });
  if (added_.empty()) return {};
  correlator_.correlate(image, coarse.patch, added_, &added_scores_);
  pixels_searched_ += static_cast<std::int64_t>(added_scores_.size());

  // A map with a rim, so that every pixel has neighbours.
  int min_u = box.max_u, max_u = box.min_u;
  for (const PixelRun& run : added_) {
    min_u = std::min(min_u, run.begin_u);
    max_u = std::max(max_u, run.end_u - 1);
  }
  const int min_v = added_.front().v, stride = max_u - min_u + 3;
  grown_scores_.assign(static_cast<std::size_t>(stride) * (added_.back().v - min_v + 3), -1.0f);
  const auto at = [&](int u, int v) {
    return &grown_scores_[static_cast<std::size_t>(v - min_v + 1) * stride + (u - min_u + 1)];
  };
  const float* scores = added_scores_.data();
  for (const PixelRun& run : added_) {
    std::copy_n(scores, run.end_u - run.begin_u, at(run.begin_u, run.v));
    scores += run.end_u - run.begin_u;
  }
  std::vector<Candidate> maxima;
  for (const PixelRun& run : added_)
    for (int u = run.begin_u; u < run.end_u; ++u) {
      const float* s = at(u, run.v);
      if (*s < kLeastCoarseScore) continue;
      // Of equal neighbours the first by row and column.
      const float before = std::max({s[-stride - 1], s[-stride], s[-stride + 1], s[-1]});
      const float after = std::max({s[1], s[stride - 1], s[stride], s[stride + 1]});
      if (*s > before && *s >= after) maxima.push_back({u - kBorder, run.v - kBorder, *s});
    }
  added_.clear();
  const auto better = [](const Candidate& a, const Candidate& b) {
    return std::make_tuple(-a.score, a.v, a.u) < std::make_tuple(-b.score, b.v, b.u);
  };
  if (maxima.size() > kPlaces) {
    std::nth_element(maxima.begin(), maxima.begin() + kPlaces, maxima.end(), better);
    maxima.resize(kPlaces);
  }
  std::sort(maxima.begin(), maxima.end(), better);
  return maxima;
}

/// The best pixel at most `reach` from (u, v), in pixels of a level with a border, which the
/// coordinates leave out. The scores of the window stay in added_scores_.
ImageFeatureSearch::Candidate ImageFeatureSearch::bestAround(const cv::Mat& image,
                                                             const Template& patch, int u, int v,
                                                             int reach) {
  constexpr int kBorder = ImagePyramid::kBorder;
  u = std::clamp(u, reach, image.cols - 1 - 2 * kBorder - reach);
  v = std::clamp(v, reach, image.rows - 1 - 2 * kBorder - reach);
  added_.clear();
  for (int dv = -reach; dv <= reach; ++dv)
    added_.push_back({v + dv + kBorder, u - reach + kBorder, u + reach + 1 + kBorder});
  correlator_.correlate(image, patch, added_, &added_scores_);
  pixels_searched_ += static_cast<std::int64_t>(added_scores_.size());
  added_.clear();
  const auto best = std::max_element(added_scores_.begin(), added_scores_.end());
  const int index = static_cast<int>(best - added_scores_.begin()), side = 2 * reach + 1;
  return {u - reach + index % side, v - reach + index / side, *best};
}

/// Follows the score on the image itself to its maximum near a place, which is a match where it is
/// high enough.
void ImageFeatureSearch::addPeakNear(Feature& feature, const Candidate& place,
                                     const PixelBox& valid, double clutter) {
  const cv::Mat& image = pyramid_.bordered(0);
  Candidate middle = place;
  for (int move = 0; move <= kMoves; ++move) {
    middle.u = std::clamp(middle.u, valid.min_u, valid.max_u);
    middle.v = std::clamp(middle.v, valid.min_v, valid.max_v);
    const Candidate best = bestAround(image, feature.patch, middle.u, middle.v, kFineReach);
    const bool is_inside = best.u >= valid.min_u && best.u <= valid.max_u &&
                           best.v >= valid.min_v && best.v <= valid.max_v;
    if (best.score < static_cast<float>(options_.match_threshold) || !is_inside ||
        !isCentre(best.u, best.v))
      return;
    constexpr int kSide = 2 * kFineReach + 1;
    const int column = best.u - middle.u + kFineReach, row = best.v - middle.v + kFineReach;
    if (column > 0 && row > 0 && column < kSide - 1 && row < kSide - 1) {
      float around[9];
      for (int dv = -1; dv <= 1; ++dv)
        std::copy_n(&added_scores_[static_cast<std::size_t>((row + dv) * kSide + column - 1)], 3,
                    &around[3 * (dv + 1)]);
      addMatch(feature, best, around, clutter);
      return;
    }
    middle = best;
  }
}

}  // namespace active_matching_slam
