#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "active_matching_slam/image/correlation.h"
#include "active_matching_slam/image/image_options.h"
#include "active_matching_slam/image/template.h"
#include "active_matching_slam/matching/feature_search.h"

namespace active_matching_slam {

/// Searches features in an image by normalised cross-correlation of their templates. A match is a
/// local maximum (3 x 3; of equal scores the first by row and column) of the score of at least
/// `match_threshold`, refined to sub-pixel (by gradients from the paraboloid's peak, or that peak where
/// they do not converge). A search reports the matches whose refined position
/// lies in the ellipse. Where a maximum touches the rim of the ellipse the neighbours needed to
/// decide it are correlated, and counted, too; a match found that way just outside is known to
/// matches() but not reported. Score maps live as long as the frame.
class ImageFeatureSearch : public FeatureSearch {
 public:
  /// Throws std::invalid_argument, see checkImageOptions().
  explicit ImageFeatureSearch(const ImageOptions& options);

  /// Starts a frame: forgets everything found and reuses the memory. Feature i is searched with
  /// `templates[i]` (copied); an empty template (size 0) never matches. `image`: 8-bit grey,
  /// shared, must not be written to during the frame; anything else is taken as an image without
  /// valid area.
  void beginFrame(const cv::Mat& image, const std::vector<Template>& templates);

  int featureCount() const override { return feature_count_; }
  SearchOutcome search(int feature, const SearchEllipse& ellipse) override;
  int countNewPixels(int feature, const SearchEllipse& ellipse) const override;
  const std::vector<SearchMatch>& matches(int feature) const override;
  const PixelMask& searchedPixels(int feature) const override;
  /// The image less the border (options.border_px, or what the template needs).
  PixelBox validArea(int feature) const override;

  /// Best scoring match of the feature so far; null when there is none.
  const SearchMatch* bestMatch(int feature) const;
  /// Distinct (feature, pixel) pairs correlated in this frame.
  std::int64_t pixelsSearched() const { return pixels_searched_; }

 private:
  /// Everything found so far about one feature. `scores` holds the box's scores, row by row; only
  /// those of the pixels in `searched` mean anything.
  struct Feature {
    Template patch;
    PixelMask searched;
    PixelBox box;
    std::vector<float> scores;
    std::vector<SearchMatch> matches;
  };
  /// A position scored at least at the threshold that may be a local maximum.
  struct Candidate {
    int u, v;
    float score;
  };

  int addRun(Feature& feature, const PixelRun& run);
  void scoreAddedRuns(Feature& feature);
  void coverBox(Feature& feature, const PixelBox& box);
  int decideCandidate(Feature& feature, const Candidate& candidate, const PixelBox& valid);
  void addMatch(Feature& feature, const Candidate& peak);

  ImageOptions options_;
  Correlator correlator_;
  cv::Mat image_;
  int feature_count_ = 0;
  std::vector<Feature> features_;  ///< never shrinks, so that its memory is reused
  std::int64_t pixels_searched_ = 0;

  // Scratch of one search.
  std::vector<PixelRun> added_;
  std::vector<float> added_scores_, grown_scores_;
  std::vector<Candidate> candidates_;
};

}  // namespace active_matching_slam
