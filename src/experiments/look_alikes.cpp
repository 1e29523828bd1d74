// Figure 5.7: some features look like many places of the image, others like none but their own. And
// by the scale at which they are detected (section 5.4.1): how many look alike, and how exactly the
// place of one is found again.

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>

#include "active_matching_slam/image/corners.h"
#include "active_matching_slam/image/image_feature_search.h"
#include "active_matching_slam/visualisation/debug_canvas.h"
#include "match_replay.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

/// All places of the image that answer to each template.
std::vector<std::vector<SearchMatch>> searchWholeImage(const cv::Mat& image,
                                                       const std::vector<Template>& templates) {
  ImageFeatureSearch search((ImageOptions()));
  search.beginFrame(image, templates);
  const SearchEllipse everywhere{{0.5 * image.cols, 0.5 * image.rows},
                                 Eigen::Matrix2d::Identity() * image.cols * image.cols};
  std::vector<std::vector<SearchMatch>> matches;
  for (int f = 0; f < search.featureCount(); ++f) {
    search.search(f, everywhere);
    matches.push_back(search.matches(f));
  }
  return matches;
}

/// Pearson's, of the ranks (Spearman's, with equal values in the order they come).
double rankCorrelation(const std::vector<double>& x, const std::vector<double>& y) {
  const auto ranksOf = [](const std::vector<double>& values) {
    std::vector<double> ranks;
    for (const double value : values) {
      const auto below =
          std::count_if(values.begin(), values.end(), [&](double other) { return other < value; });
      const auto equal = std::count(values.begin(), values.end(), value);
      ranks.push_back(static_cast<double>(below) + 0.5 * static_cast<double>(equal - 1));
    }
    return ranks;
  };
  const std::vector<double> a = ranksOf(x), b = ranksOf(y);
  const double mean = 0.5 * static_cast<double>(x.size() - 1);
  double aa = 0.0, bb = 0.0, ab = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    aa += (a[i] - mean) * (a[i] - mean);
    bb += (b[i] - mean) * (b[i] - mean);
    ab += (a[i] - mean) * (b[i] - mean);
  }
  return aa > 0.0 && bb > 0.0 ? ab / std::sqrt(aa * bb) : 0.0;
}

cv::Mat drawMatches(const cv::Mat& image, const std::vector<SearchMatch>& matches,
                    const std::string& caption) {
  DebugCanvas canvas(image);
  for (const SearchMatch& match : matches)
    canvas.dot(match.pixel, 4.0, cv::Scalar(40, 255 * std::max(0.0, 5.0 * match.score - 4.0), 255));
  return captioned(canvas.image(), canvas.unit(), caption);
}

/// Of corners found at one level of a pyramid, in units of that level but for the error.
struct Scale {
  int corners = 0, found = 0;
  double alike = 0.0, alike_per_megapixel = 0.0;
  double squares_px2 = 0.0;  ///< of the distance from the true place, of the image itself
  double rmsError() const { return std::sqrt(squares_px2 / std::max(1, found)); }
};

/// Where the surface point at `pixel` of image `from` is in image `to`; NaN where it is not seen.
Eigen::Vector2d trueMove(const Sequence& sequence, const Eigen::Vector2d& pixel, int from, int to) {
  const Eigen::Isometry3d &T_from = sequence.truth[static_cast<std::size_t>(from)].T_world_camera,
                          &T_to = sequence.truth[static_cast<std::size_t>(to)].T_world_camera;
  const auto bearing = sequence.camera.unproject(pixel);
  const auto point =
      bearing ? firstHit(sequence.surfaces, T_from.translation(), T_from.linear() * *bearing)
              : std::nullopt;
  const auto moved = point ? sequence.camera.project(T_to.inverse() * *point) : std::nullopt;
  return moved && sequence.camera.isInImage(*moved) ? *moved : unknownPixel();
}

void addCorners(const Sequence& sequence, int from, int to, int level, Scale* scale) {
  constexpr int kCorners = 40;
  constexpr double kSamePx = 3.0;  // of the level: of what is farther the match is another's
  cv::Mat first = sequence.images[static_cast<std::size_t>(from)],
          second = sequence.images[static_cast<std::size_t>(to)];
  for (int k = 0; k < level; ++k) {
    cv::pyrDown(first, first);
    cv::pyrDown(second, second);
  }
  const double factor = 1 << level;
  const ImageOptions options;
  const int reach = options.template_size_px / 2;
  std::vector<Template> templates;
  std::vector<Eigen::Vector2d> places;
  for (const Corner& corner : detectCorners(first, {}, kCorners, 10.0, options)) {
    const cv::Rect around(static_cast<int>(corner.pixel.x()) - reach,
                          static_cast<int>(corner.pixel.y()) - reach, 2 * reach + 1, 2 * reach + 1);
    const auto patch = makeTemplate(first(around).clone());
    if (!patch) continue;
    templates.push_back(*patch);
    places.push_back(corner.pixel);
  }
  const auto alike = searchWholeImage(first, templates),
             again = searchWholeImage(second, templates);
  const double megapixels = 1e-6 * static_cast<double>(first.total());
  for (std::size_t i = 0; i < templates.size(); ++i) {
    ++scale->corners;
    const double others = static_cast<double>(alike[i].size()) - 1.0;
    scale->alike += others;
    scale->alike_per_megapixel += others / megapixels;
    // The middle of pixel (0, 0) of a level is that of the image's own.
    const Eigen::Vector2d truth = trueMove(sequence, factor * places[i], from, to) / factor;
    if (!truth.allFinite()) continue;
    double nearest = kSamePx;
    for (const SearchMatch& match : again[i])
      nearest = std::min(nearest, (match.pixel - truth).norm());
    if (nearest >= kSamePx) continue;
    ++scale->found;
    scale->squares_px2 += factor * factor * nearest * nearest;
  }
}

}  // namespace

ExperimentResult runLookAlikes(Workbench& bench) {
  Table table({"sequence", "image", "feature", "look_alike_places"});
  ExperimentResult result;
  std::vector<double> counts, earlier, later;
  for (const std::string& name : bench.testBedSequences()) {
    RecordingOptions options;
    options.features = bench.featureCounts().back();
    options.problems = bench.quick() ? 4 : 8;
    options.every = 4;
    const Sequence& sequence = bench.sequence(name);
    bench.say("look-alike places in " + name);
    std::map<FeatureId, double> before;
    const std::vector<RecordedProblem>& problems = bench.recording(name, options).problems;
    for (std::size_t p = 0; p < problems.size(); p += bench.quick() ? 1 : 2) {
      const RecordedProblem& problem = problems[p];
      const cv::Mat& image = sequence.images[static_cast<std::size_t>(problem.image)];
      const auto matches = searchWholeImage(image, problem.templates);
      std::size_t fewest = 0, most = 0;
      for (std::size_t f = 0; f < matches.size(); ++f) {
        const double count = static_cast<double>(matches[f].size());
        const FeatureId id = problem.prior.ids[f];
        table.add({name, problem.image, static_cast<long>(id), count});
        counts.push_back(count);
        if (before.count(id)) {
          earlier.push_back(before[id]);
          later.push_back(count);
        }
        before[id] = count;
        if (!matches[f].empty() &&
            (matches[fewest].empty() || matches[f].size() < matches[fewest].size()))
          fewest = f;
        if (matches[f].size() > matches[most].size()) most = f;
      }
      if (name == bench.mainSequence() && result.pictures.empty())
        result.pictures.emplace_back(
            "", tilePictures({drawMatches(image, matches[most],
                                          text("common: %zu places", matches[most].size())),
                              drawMatches(image, matches[fewest],
                                          text("distinctive: %zu places", matches[fewest].size()))},
                             2));
    }
  }
  result.tables.emplace_back("", table);
  if (counts.empty()) return result;
  std::sort(counts.begin(), counts.end());
  const auto quantile = [&](double q) {
    return counts[static_cast<std::size_t>(q * static_cast<double>(counts.size() - 1))];
  };
  result.findings.push_back(
      {"places of an image that look like a feature: least tenth, median, largest tenth",
       "one or two of a distinctive feature, around 20 of a common one",
       text("%.0f, %.0f, %.0f", quantile(0.1), quantile(0.5), quantile(0.9)),
       verdict(quantile(0.1) <= 2.0 && quantile(0.9) >= 10.0)});
  const double stays = rankCorrelation(earlier, later);
  result.findings.push_back(
      {"rank correlation of their number with that of the same feature some frames later",
       "a rate of the feature, to be learnt from what was seen of it",
       text("%.2f (%zu pairs)", stays, earlier.size()), verdict(stays > 0.5)});

  // The scales: a pair of images every second, a tenth of a second apart.
  const Sequence& sequence = bench.sequence(bench.mainSequence());
  std::array<Scale, 3> scales;
  Table by_scale({"level", "corners", "look_alike_places", "look_alike_places_per_megapixel",
                  "found_again", "rms_error_px"});
  std::string places, errors;
  for (std::size_t level = 0; level < scales.size(); ++level) {
    Scale& scale = scales[level];
    const int images = static_cast<int>(sequence.images.size());
    for (int i = 0; i + 3 < images; i += 30)
      addCorners(sequence, i, i + 3, static_cast<int>(level), &scale);
    const double corners = std::max(1, scale.corners);
    by_scale.add({static_cast<int>(level), scale.corners, scale.alike / corners,
                  scale.alike_per_megapixel / corners, scale.found, scale.rmsError()});
    places += text("%s1/%d: %.1f", level ? ", " : "", 1 << level, scale.alike / corners);
    errors += text("%s1/%d: %.2f", level ? ", " : "", 1 << level, scale.rmsError());
  }
  result.tables.emplace_back("scales", by_scale);
  result.findings.push_back(
      {"other places that look like a corner, by the scale of its detection", "-", places});
  result.findings.push_back({"error of the place where it is found again [px of the image]",
                             "R no longer constant across scales", errors,
                             verdict(scales[2].rmsError() > 2.0 * scales[0].rmsError())});
  return result;
}

}  // namespace active_matching_slam
