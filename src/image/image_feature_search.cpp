#include "active_matching_slam/image/image_feature_search.h"

#include <algorithm>
#include <optional>
#include <tuple>
#include <utility>

#include "active_matching_slam/image/subpixel.h"
#include "active_matching_slam/matching/search_ellipse.h"

namespace active_matching_slam {
namespace {

/// Image windows may be this much flatter than templates, for a change of gain.
constexpr double kContrastLoss = 0.25;

/// Score maps grow by this much more than needed [px], since searches of a feature overlap.
constexpr int kGrowth = 4;

/// The continuous score may peak a little farther from the best pixel than half a pixel.
constexpr double kFarthestPeak = 0.75;

const ImageOptions& checked(const ImageOptions& options) {
  checkImageOptions(options);
  return options;
}

PixelBox emptyBox() { return {0, 0, -1, -1}; }

bool contains(const PixelBox& box, int u, int v) {
  return u >= box.min_u && u <= box.max_u && v >= box.min_v && v <= box.max_v;
}

PixelBox unionOf(const PixelBox& a, const PixelBox& b) {
  if (a.max_u < a.min_u) return b;
  return {std::min(a.min_u, b.min_u), std::min(a.min_v, b.min_v), std::max(a.max_u, b.max_u),
          std::max(a.max_v, b.max_v)};
}

int widthOf(const PixelBox& box) { return box.max_u - box.min_u + 1; }
int heightOf(const PixelBox& box) { return box.max_v - box.min_v + 1; }

std::size_t indexOf(const PixelBox& box, int u, int v) {
  return static_cast<std::size_t>(v - box.min_v) * widthOf(box) + (u - box.min_u);
}

/// A plateau has one maximum: the first by row, then column.
template <typename Candidate>
bool beats(const Candidate& a, const Candidate& b) {
  return std::make_tuple(-a.score, a.v, a.u) < std::make_tuple(-b.score, b.v, b.u);
}

}  // namespace

ImageFeatureSearch::ImageFeatureSearch(const ImageOptions& options)
    : options_(checked(options)),
      correlator_(std::max(1.0, kContrastLoss * options.minimum_contrast)) {}

void ImageFeatureSearch::beginFrame(const cv::Mat& image, const std::vector<Template>& templates,
                                    const std::vector<TemplateSource>& sources,
                                    const cv::Mat& centres) {
  image_ = image.type() == CV_8UC1 ? image : cv::Mat();
  centres_ = centres;
  feature_count_ = static_cast<int>(templates.size());
  if (features_.size() < templates.size()) features_.resize(templates.size());
  for (int i = 0; i < feature_count_; ++i) {
    Feature& feature = features_[i];
    feature.patch = templates[i];
    feature.searched.clear();
    feature.box = emptyBox();
    feature.matches.clear();
    feature.peaks.clear();
    feature.is_wide = false;
    feature.covered.clear();
    feature.coarse_pixels = feature.coarse_clutter_pixels = 0.0;
    for (CoarseLevel& level : feature.coarse) {
      level.is_made = false;
      level.searched.clear();
    }
    feature.partly_masked = false;
  }
  pyramid_.begin(image_);
  sources_ = sources;
  pixels_searched_ = 0;
}

PixelBox ImageFeatureSearch::validArea(int feature) const {
  const int size = features_[feature].patch.size;
  // One pixel more than the template needs, so that a maximum on the rim has neighbours.
  const int border = std::max(options_.border_px, size / 2 + 1);
  const PixelBox box{border, border, image_.cols - 1 - border, image_.rows - 1 - border};
  return size == 0 || box.max_u < box.min_u || box.max_v < box.min_v ? emptyBox() : box;
}

int ImageFeatureSearch::countNewPixels(int feature, const SearchEllipse& ellipse) const {
  const PixelMask& searched = searchedPixels(feature);
  int count = 0;
  forEachEllipseRun(ellipse, validArea(feature), [&](const PixelRun& run) {
    forEachUnmasked(run, [&](const PixelRun& part) { count += searched.countMissing(part); });
  });
  return count;
}

SearchOutcome ImageFeatureSearch::search(int feature_index, const SearchEllipse& ellipse) {
  Feature& feature = features_[feature_index];
  const PixelBox valid = validArea(feature_index);
  SearchOutcome outcome;
  if (!isProperEllipse(ellipse)) return outcome;
  const std::int64_t searched_before = searchedPixels(feature_index).size();
  const std::int64_t correlated_before = pixels_searched_;
  forEachEllipseRun(ellipse, valid, [&](const PixelRun& run) {
    feature.partly_masked |= forEachUnmasked(
        run, [&](const PixelRun& part) { outcome.pixels_in_ellipse += part.end_u - part.begin_u; });
  });
  const int level = coarseLevel(feature_index, ellipse, outcome.pixels_in_ellipse);
  if (level > 0) {
    searchCoarseToFine(feature, ellipse, valid, level);
  } else {
    searchPixels(feature, ellipse, valid);
  }
  outcome.pixels_new = static_cast<int>(searchedPixels(feature_index).size() - searched_before);
  outcome.correlations = static_cast<int>(pixels_searched_ - correlated_before);
  for (const SearchMatch& match : feature.matches)
    if (mahalanobisSquared(ellipse, match.pixel) <= kEllipseRadius2)
      outcome.matches.push_back(match.id);
  return outcome;
}

void ImageFeatureSearch::searchPixels(Feature& feature, const SearchEllipse& ellipse,
                                      const PixelBox& valid) {
  added_.clear();
  candidates_.clear();
  forEachEllipseRun(ellipse, valid, [&](const PixelRun& run) {
    forEachUnmasked(run, [&](const PixelRun& part) { addSearchedRun(feature, part); });
  });
  scoreAddedRuns(feature);
  // The list grows while it is worked off.
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    const Candidate candidate = candidates_[i];
    decideCandidate(feature, candidate, valid);
  }
}

const std::vector<SearchMatch>& ImageFeatureSearch::matches(int feature) const {
  return features_[feature].matches;
}

const PixelMask& ImageFeatureSearch::searchedPixels(int feature) const {
  const Feature& known = features_[feature];
  return known.is_wide ? known.covered : known.searched;
}

const SearchMatch* ImageFeatureSearch::bestMatch(int feature) const {
  const std::vector<SearchMatch>& matches = features_[feature].matches;
  const auto best = std::max_element(
      matches.begin(), matches.end(),
      [](const SearchMatch& a, const SearchMatch& b) { return a.score < b.score; });
  return best == matches.end() ? nullptr : &*best;
}

/// Marks a run as correlated; its new parts are appended to added_, to be scored.
void ImageFeatureSearch::addRun(Feature& feature, const PixelRun& run) {
  pixels_searched_ += feature.searched.insert(run, &added_);
  if (feature.is_wide) feature.covered.insert(run);
}

/// The same, less what was searched coarse to fine already.
void ImageFeatureSearch::addSearchedRun(Feature& feature, const PixelRun& run) {
  if (!feature.is_wide) {
    addRun(feature, run);
    return;
  }
  uncovered_.clear();
  feature.covered.insert(run, &uncovered_);
  for (const PixelRun& part : uncovered_) addRun(feature, part);
}

/// Scores the pixels of added_ into the feature's map and lists those that may be matches.
void ImageFeatureSearch::scoreAddedRuns(Feature& feature) {
  if (added_.empty()) return;
  PixelBox needed{added_.front().begin_u, added_.front().v, added_.front().end_u - 1,
                  added_.back().v};
  for (const PixelRun& run : added_) {
    needed.min_u = std::min(needed.min_u, run.begin_u);
    needed.max_u = std::max(needed.max_u, run.end_u - 1);
  }
  coverBox(feature, needed);
  correlator_.correlate(image_, feature.patch, added_, &added_scores_);
  const float threshold = static_cast<float>(options_.match_threshold);
  const float* score = added_scores_.data();
  for (const PixelRun& run : added_) {
    float* to = &feature.scores[indexOf(feature.box, run.begin_u, run.v)];
    for (int u = run.begin_u; u < run.end_u; ++u, ++score) {
      *to++ = *score;
      if (*score >= threshold) candidates_.push_back({u, run.v, *score});
    }
  }
  added_.clear();
}

/// Grows the feature's score map to contain `box`.
void ImageFeatureSearch::coverBox(Feature& feature, const PixelBox& box) {
  const PixelBox old = feature.box;
  PixelBox grown = unionOf(old, box);
  if (contains(old, box.min_u, box.min_v) && contains(old, box.max_u, box.max_v)) return;
  grown = {grown.min_u - kGrowth, grown.min_v - kGrowth, grown.max_u + kGrowth,
           grown.max_v + kGrowth};
  grown_scores_.resize(static_cast<std::size_t>(widthOf(grown)) * heightOf(grown));
  for (int v = old.min_v; v <= old.max_v; ++v)
    std::copy_n(&feature.scores[indexOf(old, old.min_u, v)], widthOf(old),
                &grown_scores_[indexOf(grown, old.min_u, v)]);
  std::swap(feature.scores, grown_scores_);
  feature.box = grown;
}

/// Finds out whether a candidate is a local maximum. Neighbours
/// scored for it that are better become candidates themselves, so that every searched pixel is in
/// the end either below the threshold, beaten by a neighbour, or a match.
void ImageFeatureSearch::decideCandidate(Feature& feature, const Candidate& candidate,
                                         const PixelBox& valid) {
  // Neighbours just outside the valid area may be scored to decide, but are no matches.
  if (!contains(valid, candidate.u, candidate.v) || !isCentre(candidate.u, candidate.v)) return;
  const int u = candidate.u, v = candidate.v;
  for (int dv = -1; dv <= 1; ++dv)
    for (int du = -1; du <= 1; ++du)
      if (feature.searched.contains(u + du, v + dv) &&
          beats(Candidate{u + du, v + dv, feature.scores[indexOf(feature.box, u + du, v + dv)]},
                candidate))
        return;
  const std::size_t known = candidates_.size();
  for (int dv = -1; dv <= 1; ++dv) addRun(feature, {v + dv, u - 1, u + 2});
  scoreAddedRuns(feature);
  const auto worse = [&](const Candidate& other) { return !beats(other, candidate); };
  candidates_.erase(std::remove_if(candidates_.begin() + known, candidates_.end(), worse),
                    candidates_.end());
  if (candidates_.size() > known) return;
  float around[9];
  for (int dv = -1; dv <= 1; ++dv)
    std::copy_n(&feature.scores[indexOf(feature.box, u - 1, v + dv)], 3, &around[3 * (dv + 1)]);
  addMatch(feature, candidate, around, 1.0);
}

/// `around`: the scores of the peak and its neighbours, row by row.
void ImageFeatureSearch::addMatch(Feature& feature, const Candidate& peak, const float around[9],
                                  double clutter) {
  const cv::Point pixel(peak.u, peak.v);
  if (std::find(feature.peaks.begin(), feature.peaks.end(), pixel) != feature.peaks.end()) return;
  feature.peaks.push_back(pixel);
  const Eigen::Vector2d middle(peak.u, peak.v), start = middle + paraboloidPeak(around);
  const std::optional<TemplateFit> fit = refineSubpixel(image_, feature.patch, start);
  SearchMatch match;
  match.pixel = start;
  if (fit && (fit->pixel - middle).cwiseAbs().maxCoeff() <= kFarthestPeak) {
    match.pixel = fit->pixel;
    match.sigma_px = fit->sigma_px;
    match.noise_shape = fit->noise_shape;
  }
  match.score = peak.score;
  match.clutter = clutter;
  match.id = static_cast<int>(feature.matches.size());
  feature.matches.push_back(match);
}

}  // namespace active_matching_slam
