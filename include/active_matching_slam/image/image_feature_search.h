#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "active_matching_slam/image/correlation.h"
#include "active_matching_slam/image/image_options.h"
#include "active_matching_slam/image/image_pyramid.h"
#include "active_matching_slam/image/template.h"
#include "active_matching_slam/image/warp.h"
#include "active_matching_slam/matching/feature_search.h"

namespace active_matching_slam {

/// Searches features in an image by normalised cross-correlation of their templates. A match is a
/// local maximum (3 x 3; of equal scores the first by row and column) of the score of at least
/// `match_threshold`, refined to sub-pixel (by gradients from the paraboloid's peak, or that peak
/// where they do not converge). A search reports the matches whose refined position lies in the
/// ellipse. Where a maximum touches the rim of the ellipse the neighbours needed to decide it are
/// correlated, and counted, too; a match found that way just outside is known to matches() but not
/// reported. Score maps live as long as the frame.
///
/// Wide ellipses, of some thousand pixels and more, are searched coarse to fine: at the level of an
/// image pyramid at which they have about a thousand, with templates that show more of the
/// feature's surroundings; around what resembles these most the level below is searched, and so on.
/// What was searched so counts as searched, though few of its pixels were correlated.
class ImageFeatureSearch : public FeatureSearch {
 public:
  /// Throws std::invalid_argument, see checkImageOptions().
  explicit ImageFeatureSearch(const ImageOptions& options);

  /// Starts a frame: forgets everything found and reuses the memory. Feature i is searched with
  /// `templates[i]` (copied); an empty template (size 0) never matches. `image`: 8-bit grey,
  /// shared, must not be written to during the frame; anything else is taken as an image without
  /// valid area.
  /// `sources`: what these were warped from, one each, for wide ellipses; empty: those are searched
  /// pixel by pixel. `centres`: of the image's size, CV_8U; where it is 0 nothing is searched (see
  /// ImageMask::templateCentres()); empty: nothing is left out.
  void beginFrame(const cv::Mat& image, const std::vector<Template>& templates,
                  const std::vector<TemplateSource>& sources = {},
                  const cv::Mat& centres = cv::Mat());

  int featureCount() const override { return feature_count_; }
  SearchOutcome search(int feature, const SearchEllipse& ellipse) override;
  int countNewPixels(int feature, const SearchEllipse& ellipse) const override;
  double expectedCost(int feature, double area_px) const override;
  const std::vector<SearchMatch>& matches(int feature) const override;
  const PixelMask& searchedPixels(int feature) const override;
  /// The image less the border (options.border_px, or what the template needs).
  PixelBox validArea(int feature) const override;

  /// Best scoring match of the feature so far; null when there is none.
  const SearchMatch* bestMatch(int feature) const;
  /// Whether a search of the feature reached where no pixel is searched: it may lie there.
  bool isPartlyMasked(int feature) const { return features_[feature].partly_masked; }
  /// Correlations made in this frame: distinct (feature, pixel) pairs.
  std::int64_t pixelsSearched() const { return pixels_searched_; }
  /// Pixels which, correlated one by one, would bring as many spurious matches of the feature as
  /// its searches in this frame do.
  double clutterPixels(int feature) const;

 private:
  static constexpr int kCoarsestLevel = 2;

  /// A feature on one level of the pyramid; coordinates include its border.
  struct CoarseLevel {
    bool is_made = false;
    Template patch;  ///< empty: none
    PixelMask searched;
  };
  /// Everything found so far about one feature. `scores` holds the box's scores, row by row; only
  /// those of the pixels in `searched` mean anything.
  struct Feature {
    Template patch;
    PixelMask searched;
    PixelBox box;
    std::vector<float> scores;
    std::vector<SearchMatch> matches;
    std::vector<cv::Point> peaks;  ///< best pixels of these
    bool is_wide = false;          ///< some search was coarse to fine
    PixelMask covered;             ///< then: all that was searched either way
    double coarse_pixels = 0.0, coarse_clutter_pixels = 0.0;
    std::array<CoarseLevel, kCoarsestLevel> coarse;  ///< levels 1, 2 ...
    bool partly_masked = false;
  };
  /// A position scored at least at the threshold that may be a local maximum.
  struct Candidate {
    int u, v;
    float score;
  };

  void searchPixels(Feature& feature, const SearchEllipse& ellipse, const PixelBox& valid);
  void addRun(Feature& feature, const PixelRun& run);
  void addSearchedRun(Feature& feature, const PixelRun& run);
  bool isCentre(int u, int v) const {
    return centres_.empty() || centres_.at<std::uint8_t>(v, u) != 0;
  }
  /// Calls f for the parts of a run that may be searched; whether that is less than all of it.
  template <typename F>
  bool forEachUnmasked(const PixelRun& run, F f) const {
    if (centres_.empty()) {
      f(run);
      return false;
    }
    int unmasked = 0;
    for (int u = run.begin_u; u < run.end_u;) {
      int end = u;
      while (end < run.end_u && isCentre(end, run.v)) ++end;
      if (end > u) f(PixelRun{run.v, u, end});
      unmasked += end - u;
      u = end + 1;
    }
    return unmasked < run.end_u - run.begin_u;
  }
  void scoreAddedRuns(Feature& feature);
  void coverBox(Feature& feature, const PixelBox& box);
  void decideCandidate(Feature& feature, const Candidate& candidate, const PixelBox& valid);
  void addMatch(Feature& feature, const Candidate& peak, const float around[9], double clutter);

  int coarseLevel(int feature, const SearchEllipse& ellipse, int pixels_in_ellipse);
  bool hasCoarseTemplate(int feature, int level);
  void searchCoarseToFine(Feature& feature, const SearchEllipse& ellipse, const PixelBox& valid,
                          int level);
  std::vector<Candidate> coarseMaxima(Feature& feature, const SearchEllipse& ellipse,
                                      const PixelBox& valid, int level);
  Candidate bestAround(const cv::Mat& image, const Template& patch, int u, int v, int reach);
  void addPeakNear(Feature& feature, const Candidate& candidate, const PixelBox& valid,
                   double clutter);

  ImageOptions options_;
  Correlator correlator_;
  cv::Mat image_, centres_;
  ImagePyramid pyramid_;
  std::vector<TemplateSource> sources_;
  int feature_count_ = 0;
  std::vector<Feature> features_;  ///< never shrinks, so that its memory is reused
  std::int64_t pixels_searched_ = 0;

  // Scratch of one search.
  std::vector<PixelRun> added_, uncovered_;
  std::vector<float> added_scores_, grown_scores_;
  std::vector<Candidate> candidates_;
};

}  // namespace active_matching_slam
