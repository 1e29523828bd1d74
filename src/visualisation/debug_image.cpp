#include "active_matching_slam/visualisation/debug_image.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <string>
#include <unordered_map>

#include "active_matching_slam/information/submap_color.h"
#include "active_matching_slam/visualisation/debug_canvas.h"
#include "active_matching_slam/visualisation/link_view.h"
#include "active_matching_slam/visualisation/submap_view.h"

namespace active_matching_slam {
namespace {

const cv::Scalar kGreen(90, 230, 60), kOrange(20, 150, 255), kRed(60, 60, 255), kGold(40, 200, 255),
    kWhite(255, 255, 255), kGrey(170, 170, 170);
/// Of the full gates: they are many, and the picture below should stay visible.
constexpr double kGateOpacity = 0.6;

cv::Scalar statusColor(const TrackedFeature& feature) {
  switch (feature.status) {
    case FeatureStatus::kMatched:
      return kGreen;
    case FeatureStatus::kRejected:
      return kOrange;
    case FeatureStatus::kMissed:
      return kRed;
    default:
      return kGrey;
  }
}

/// From first (0), cyan, to last (1), magenta: the brighter the earlier, and neither is the colour
/// of a status.
cv::Scalar orderColor(double fraction) {
  const double s = std::clamp(fraction, 0.0, 1.0);
  return {255.0, 255.0 * (1.0 - s), 255.0 * s};
}

/// From violet (0) to yellow (1), in even steps of brightness.
cv::Scalar strengthColor(double fraction) {
  static const cv::Mat palette = [] {
    cv::Mat values(1, 256, CV_8UC1), colors;
    for (int value = 0; value < 256; ++value) values.at<uchar>(value) = uchar(value);
    cv::applyColorMap(values, colors, cv::COLORMAP_VIRIDIS);
    return colors;
  }();
  const auto& bgr = palette.at<cv::Vec3b>(cvRound(40 + 215 * std::clamp(fraction, 0.0, 1.0)));
  return {double(bgr[0]), double(bgr[1]), double(bgr[2])};
}

/// Of the map's graph what is worth showing between features that are predicted to be in the image.
class VisibleLinks {
 public:
  VisibleLinks(const TrackedFrame& frame, const DrawOptions& options) : frame_(frame) {
    if (!frame.graph) return;
    for (std::size_t i = 0; i < frame.features.size(); ++i)
      if (frame.features[i].status != FeatureStatus::kNotVisible)
        index_[frame.features[i].id] = static_cast<int>(i);
    std::vector<InformationLink> links;
    for (const InformationLink& link : frame.graph->links)
      if (index_.count(link.first) > 0 && index_.count(link.second) > 0) links.push_back(link);
    links_ = linksToShow(std::move(links), options);
  }

  /// The weakest first.
  const std::vector<InformationLink>& links() const { return links_; }
  /// Indices of frame.features.
  std::pair<int, int> ends(const InformationLink& link) const {
    return {index_.at(link.first), index_.at(link.second)};
  }
  void draw(const InformationLink& link, const cv::Scalar& color, double width,
            DebugCanvas* canvas) const {
    const auto [first, second] = ends(link);
    canvas->line(frame_.features[first].predicted_px, frame_.features[second].predicted_px, color,
                 width);
  }

 private:
  const TrackedFrame& frame_;
  std::unordered_map<FeatureId, int> index_;
  std::vector<InformationLink> links_;
};

/// From violet (none) to yellow (the strongest in view).
void drawLinks(const VisibleLinks& visible, double minimum_bits, DebugCanvas* canvas) {
  if (visible.links().empty()) return;
  const double strongest = visible.links().back().information_bits;
  for (const InformationLink& link : visible.links())
    if (link.information_bits >= minimum_bits)
      visible.draw(link, strengthColor(link.information_bits / strongest), 1.0, canvas);
}

/// The matcher's own tree where it has one, else the map's.
void drawTree(const TrackedFrame& frame, const VisibleLinks& visible, DebugCanvas* canvas) {
  constexpr double kWidth = 1.6;
  const int count = frame.prior.size();
  for (const auto& [i, j] : frame.matching.tree_edges)
    if (i >= 0 && j >= 0 && i < count && j < count)
      canvas->line(frame.prior.mean(i), frame.prior.mean(j), kGold, kWidth);
  if (!frame.matching.tree_edges.empty()) return;
  for (const InformationLink& link : visible.links())
    if (link.in_tree) visible.draw(link, kGold, kWidth, canvas);
}

cv::Scalar submapScalar(int submap) {
  const Eigen::Vector3f rgb = 255.0f * submapRgb(submap);
  return {rgb[2], rgb[1], rgb[0]};
}

/// The map's tree inside each submap, and each feature, in the submap's colour; what joins two
/// submaps in grey.
void drawSubmaps(const TrackedFrame& frame, const VisibleLinks& visible, int level,
                 DebugCanvas* canvas) {
  const std::vector<int> submaps = submapsAtLevel(frame, level);
  for (const InformationLink& link : visible.links()) {
    if (!link.in_tree) continue;
    const auto [first, second] = visible.ends(link);
    const bool inside = submaps[first] == submaps[second];
    visible.draw(link, inside ? submapScalar(submaps[first]) : kGrey, inside ? 2.0 : 1.0, canvas);
  }
  for (std::size_t i = 0; i < frame.features.size(); ++i)
    if (frame.features[i].status != FeatureStatus::kNotVisible && submaps[i] >= 0)
      canvas->dot(frame.features[i].predicted_px, 5.0, submapScalar(submaps[i]));
}

void drawGates(const TrackedFrame& frame, DebugCanvas* canvas) {
  const cv::Mat before = canvas->image().clone();
  for (const TrackedFeature& feature : frame.features)
    if (feature.status != FeatureStatus::kNotVisible)
      canvas->ellipse(feature.predicted_px, feature.innovation_covariance_px2,
                      statusColor(feature));
  cv::addWeighted(canvas->image(), kGateOpacity, before, 1.0 - kGateOpacity, 0.0, canvas->image());
}

cv::Scalar colorOfStep(const TrackedFrame& frame, std::size_t step) {
  return orderColor(step / std::max(1.0, frame.matching.trace.size() - 1.0));
}

void drawSearches(const TrackedFrame& frame, DebugCanvas* canvas) {
  for (std::size_t i = 0; i < frame.matching.trace.size(); ++i) {
    const SearchEllipse& ellipse = frame.matching.trace[i].ellipse;
    canvas->ellipse(ellipse.center, ellipse.covariance, colorOfStep(frame, i));
  }
}

/// Where a search found nothing, though another of the same feature may have: with its number among
/// the frame's searches. Matchers that leave no trace search the gates whole.
void drawNullSearches(const TrackedFrame& frame, DebugCanvas* canvas) {
  constexpr double kRadius = 3.5;
  const std::vector<MatchStep>& trace = frame.matching.trace;
  for (std::size_t i = 0; i < trace.size(); ++i) {
    if (!trace[i].matches.empty()) continue;
    canvas->cross(trace[i].ellipse.center, kRadius, kRed);
    canvas->label(trace[i].ellipse.center, std::to_string(i + 1), colorOfStep(frame, i));
  }
  if (!trace.empty()) return;
  for (const TrackedFeature& feature : frame.features)
    if (feature.status == FeatureStatus::kMissed)
      canvas->cross(feature.predicted_px, kRadius, kRed);
}

/// Of a feature's matches that were not accepted the best few: where much of the image is searched
/// there are thousands.
void drawOtherMatches(const TrackedFrame& frame, DebugCanvas* canvas) {
  constexpr std::size_t kMost = 6;
  for (std::size_t i = 0; i < frame.matches.size(); ++i) {
    std::vector<SearchMatch> matches = frame.matches[i];
    if (i < frame.matching.match_of_feature.size() && frame.matching.match_of_feature[i] >= 0)
      matches.erase(matches.begin() + frame.matching.match_of_feature[i]);
    const auto end = matches.begin() + std::min(kMost, matches.size());
    std::partial_sort(matches.begin(), end, matches.end(),
                      [](const SearchMatch& a, const SearchMatch& b) { return a.score > b.score; });
    for (auto match = matches.begin(); match != end; ++match)
      canvas->diamond(match->pixel, 3.0, kOrange);
  }
}

void drawMatches(const TrackedFrame& frame, DebugCanvas* canvas) {
  drawOtherMatches(frame, canvas);
  for (const TrackedFeature& feature : frame.features) {
    if (feature.status != FeatureStatus::kMatched) continue;
    canvas->line(feature.predicted_px, feature.matched_px, kGreen);
    canvas->dot(feature.matched_px, 2.0, feature.known ? kWhite : kGreen);
  }
}

void drawTemplates(const TrackedFrame& frame, DebugCanvas* canvas) {
  cv::Mat& image = canvas->image();
  const int side = cvRound(32 * canvas->unit()), gap = cvRound(2 * canvas->unit());
  int x = gap;
  const int y = image.rows - side - gap;
  if (y < 0) return;
  for (const TrackedFeature& feature : frame.features) {
    if (feature.status == FeatureStatus::kNotVisible || feature.template_image.empty()) continue;
    if (feature.template_image.type() != CV_8UC1) continue;
    if (x + side + gap > image.cols) return;
    const cv::Rect place(x, y, side, side);
    cv::Mat patch;
    cv::resize(feature.template_image, patch, place.size(), 0, 0, cv::INTER_NEAREST);
    cv::cvtColor(patch, image(place), cv::COLOR_GRAY2BGR);
    cv::rectangle(image, place, statusColor(feature), std::max(1, gap / 2));
    x += side + gap;
  }
}

void drawInformation(const TrackedFrame& frame, DebugCanvas* canvas) {
  const auto bits_of = predictedInformationBits(frame);
  for (const TrackedFeature& feature : frame.features) {
    const auto bits = bits_of.find(feature.id);
    if (bits == bits_of.end()) continue;
    char text[16];
    std::snprintf(text, sizeof text, "%.1f", bits->second);
    canvas->label(feature.predicted_px, text, kWhite);
  }
}

std::string shortCount(std::int64_t count) {
  char text[32];
  if (count < 1000000)
    std::snprintf(text, sizeof text, "%.1fk", count / 1e3);
  else
    std::snprintf(text, sizeof text, "%.1fM", count / 1e6);
  return text;
}

/// The image with what was not used at half its brightness.
cv::Mat darkened(const cv::Mat& image, const cv::Mat& mask) {
  cv::Mat result = 0.5 * image;
  image.copyTo(result, mask);
  return result;
}

std::string statusText(const TrackedFrame& frame) {
  const MatchStatistics& s = frame.matching.statistics;
  if (frame.state != TrackingState::kTracking)
    return trackingStateName(frame.state) + ": " + frame.reason;
  char numbers[160];
  std::snprintf(numbers, sizeof numbers, "  %d/%d matched  %.0f bits  %s of %s px  %.1f ms",
                s.matched, s.candidates, frame.camera_bits, shortCount(s.pixels_searched).c_str(),
                shortCount(s.pixels_full_gates).c_str(), frame.timings_ms.total);
  const std::string scale = frame.scale_source == ScaleSource::kFree ? "  scale free" : "";
  return trackingStateName(frame.state) + "  " + s.matcher + numbers + scale;
}

std::vector<LegendEntry> legendOf(const DrawOptions& options) {
  using Symbol = LegendEntry::Symbol;
  std::vector<LegendEntry> legend;
  const auto add = [&](Symbol symbol, const cv::Scalar& color, const std::string& text) {
    legend.push_back({symbol, [color](double) { return color; }, text});
  };
  if (options.predictions) {
    add(Symbol::kEllipse, kGreen, "gate: matched");
    add(Symbol::kEllipse, kOrange, "rejected");
    add(Symbol::kEllipse, kRed, "missed");
    add(Symbol::kEllipse, kGrey, "not searched");
  }
  if (options.searches) legend.push_back({Symbol::kEllipse, orderColor, "searched, first to last"});
  if (options.matches) {
    add(Symbol::kDot, kGreen, "match");
    add(Symbol::kDiamond, kOrange, "other match");
    add(Symbol::kCross, kRed, "search that found nothing");
  }
  if (options.tree) add(Symbol::kLine, kGold, "tree");
  if (options.links) legend.push_back({Symbol::kLine, strengthColor, "bits, few to many"});
  if (options.submaps)
    legend.push_back({Symbol::kDot,
                      [](double fraction) { return submapScalar(cvRound(2 * fraction)); },
                      "submaps"});
  if (options.information) add(Symbol::kNone, kWhite, "5.1: information of a match, bits");
  return legend;
}

}  // namespace

cv::Mat drawDebugImage(const TrackedFrame& frame, const DrawOptions& options, int submap_level) {
  if (frame.image.empty()) return {};
  DebugCanvas canvas(frame.mask.empty() ? frame.image : darkened(frame.image, frame.mask));
  const VisibleLinks visible(frame, options);
  if (options.links) drawLinks(visible, options.minimum_link_bits, &canvas);
  if (options.tree) drawTree(frame, visible, &canvas);
  if (options.predictions) drawGates(frame, &canvas);
  if (options.matches) drawMatches(frame, &canvas);
  if (options.searches) drawSearches(frame, &canvas);
  if (options.matches) drawNullSearches(frame, &canvas);
  if (options.submaps) drawSubmaps(frame, visible, submap_level, &canvas);
  if (options.information) drawInformation(frame, &canvas);
  if (options.templates) drawTemplates(frame, &canvas);
  const bool well = frame.state == TrackingState::kTracking;
  return withFooter(canvas.image(), canvas.unit(), options.status ? statusText(frame) : "",
                    well ? kWhite : kOrange,
                    options.legend ? legendOf(options) : std::vector<LegendEntry>());
}

}  // namespace active_matching_slam
