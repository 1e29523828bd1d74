#include "active_matching_slam/image/target_detector.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#ifdef AMS_HAS_ARUCO
#include <opencv2/aruco.hpp>
#endif

namespace active_matching_slam {
namespace {

/// Half the side of the window in which a corner is refined, as a fraction of the shortest distance
/// between two. Derivation: a tag's cells are at most an eighth of it, and the window must hold no
/// second corner.
constexpr double kRefinedFraction = 1.0 / 16.0;
/// Cost: larger windows smooth more, and see more of what lies around the target.
constexpr int kLargestRefinement_px = 5;

#ifdef AMS_HAS_ARUCO
struct NamedDictionary {
  const char* name;
  int value;
};
const NamedDictionary kDictionaries[] = {
    {"tag16h5", cv::aruco::DICT_APRILTAG_16h5},
    {"tag25h9", cv::aruco::DICT_APRILTAG_25h9},
    {"tag36h10", cv::aruco::DICT_APRILTAG_36h10},
    {"tag36h11", cv::aruco::DICT_APRILTAG_36h11},
    {"DICT_4X4_50", cv::aruco::DICT_4X4_50},
    {"DICT_4X4_100", cv::aruco::DICT_4X4_100},
    {"DICT_4X4_250", cv::aruco::DICT_4X4_250},
    {"DICT_4X4_1000", cv::aruco::DICT_4X4_1000},
    {"DICT_5X5_50", cv::aruco::DICT_5X5_50},
    {"DICT_5X5_100", cv::aruco::DICT_5X5_100},
    {"DICT_5X5_250", cv::aruco::DICT_5X5_250},
    {"DICT_5X5_1000", cv::aruco::DICT_5X5_1000},
    {"DICT_6X6_50", cv::aruco::DICT_6X6_50},
    {"DICT_6X6_100", cv::aruco::DICT_6X6_100},
    {"DICT_6X6_250", cv::aruco::DICT_6X6_250},
    {"DICT_6X6_1000", cv::aruco::DICT_6X6_1000},
    {"DICT_7X7_50", cv::aruco::DICT_7X7_50},
    {"DICT_7X7_100", cv::aruco::DICT_7X7_100},
    {"DICT_7X7_250", cv::aruco::DICT_7X7_250},
    {"DICT_7X7_1000", cv::aruco::DICT_7X7_1000},
    {"DICT_ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL},
};

cv::Ptr<cv::aruco::Dictionary> dictionaryOf(const TargetDescription& tag) {
  for (const NamedDictionary& known : kDictionaries)
    if (tag.dictionary == known.name) return cv::aruco::getPredefinedDictionary(known.value);
  throw std::invalid_argument("dictionary = '" + tag.dictionary + "' is unknown");
}
#endif

void requireLength(const std::string& name, double value) {
  if (!(value > 0.0) || !std::isfinite(value))
    throw std::invalid_argument(name + " = " + std::to_string(value) + " must be positive");
}

void checkTag(const TargetDescription& tag) {
  const auto& names = tagDictionaries();
  if (names.empty())
    throw std::invalid_argument(
        "tags need OpenCV's aruco module, without which this was built (libopencv-contrib-dev)");
  if (std::find(names.begin(), names.end(), tag.dictionary) == names.end()) {
    std::string all;
    for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
    throw std::invalid_argument("dictionary = '" + tag.dictionary + "' must be one of " + all);
  }
#ifdef AMS_HAS_ARUCO
  const int count = dictionaryOf(tag)->bytesList.rows;
  if (tag.id < 0 || tag.id >= count)
    throw std::invalid_argument("id = " + std::to_string(tag.id) + " must be in [0, " +
                                std::to_string(count - 1) + "], as of " + tag.dictionary);
#endif
  requireLength("size_m", tag.size_m);
}

void checkChessboard(const TargetDescription& board) {
  for (const auto& [name, value] :
       {std::pair{"columns", board.columns}, std::pair{"rows", board.rows}})
    if (value < 3 || value > 100)
      throw std::invalid_argument(std::string(name) + " = " + std::to_string(value) +
                                  " must be in [3, 100]: inner corners");
  requireLength("square_m", board.square_m);
}

std::vector<Eigen::Vector2d> rectangle(double width, double height) {
  return {{0.0, 0.0}, {width, 0.0}, {width, height}, {0.0, height}};
}

std::vector<cv::Point2f> tagCorners([[maybe_unused]] const TargetDescription& tag,
                                    [[maybe_unused]] const cv::Mat& image) {
#ifdef AMS_HAS_ARUCO
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(image, dictionaryOf(tag), corners, ids);
  // A tag that stands there twice could be either.
  if (std::count(ids.begin(), ids.end(), tag.id) != 1) return {};
  return corners[static_cast<std::size_t>(std::find(ids.begin(), ids.end(), tag.id) - ids.begin())];
#else
  return {};
#endif
}

std::vector<cv::Point2f> chessboardCorners(const TargetDescription& board, const cv::Mat& image) {
  std::vector<cv::Point2f> corners;
  const bool is_found = cv::findChessboardCorners(
      image, {board.columns, board.rows}, corners,
      cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK);
  if (!is_found) return {};
  const auto columns = static_cast<std::size_t>(board.columns);
  const auto rows = static_cast<std::size_t>(board.rows);
  return {corners[0], corners[columns - 1], corners[rows * columns - 1],
          corners[(rows - 1) * columns]};
}

double shortestDistance(const std::vector<cv::Point2f>& corners) {
  double shortest = 1e9;
  for (std::size_t i = 0; i < corners.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      shortest = std::min(shortest, cv::norm(corners[i] - corners[j]));
  return shortest;
}

}  // namespace

const std::vector<std::string>& tagDictionaries() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
#ifdef AMS_HAS_ARUCO
    for (const NamedDictionary& dictionary : kDictionaries) list.emplace_back(dictionary.name);
#endif
    return list;
  }();
  return names;
}

void checkTarget(const TargetDescription& target) {
  if (target.kind == TargetDescription::Kind::kTag) checkTag(target);
  if (target.kind == TargetDescription::Kind::kChessboard) checkChessboard(target);
}

TargetDetector::TargetDetector(const TargetDescription& target) : target_(target) {
  checkTarget(target);
}

TargetSighting TargetDetector::detect(const cv::Mat& image) const {
  TargetSighting sighting;
  std::vector<cv::Point2f> corners;
  double width = target_.size_m, height = target_.size_m, unit = 1.0;
  if (target_.kind == TargetDescription::Kind::kTag) {
    corners = tagCorners(target_, image);
  } else if (target_.kind == TargetDescription::Kind::kChessboard) {
    corners = chessboardCorners(target_, image);
    unit = std::min(target_.columns, target_.rows) - 1;
    width = (target_.columns - 1) * target_.square_m;
    height = (target_.rows - 1) * target_.square_m;
  }
  if (corners.empty()) return sighting;
  // A chessboard's next corner is a square away, a tag's the width of its border.
  const double reach = unit > 1.0 ? shortestDistance(corners) / unit / 2.0
                                  : shortestDistance(corners) * kRefinedFraction;
  const int half = std::clamp(static_cast<int>(reach), 2, kLargestRefinement_px);
  cv::cornerSubPix(image, corners, {half, half}, {-1, -1},
                   {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 40, 0.005});
  for (const cv::Point2f& corner : corners) sighting.pixels.emplace_back(corner.x, corner.y);
  sighting.positions_m = rectangle(width, height);
  return sighting;
}

cv::Mat drawTag([[maybe_unused]] const TargetDescription& tag, [[maybe_unused]] int side_px) {
  checkTag(tag);
  cv::Mat image;
#ifdef AMS_HAS_ARUCO
  cv::aruco::drawMarker(dictionaryOf(tag), tag.id, side_px, image, 1);
#endif
  return image;
}

}  // namespace active_matching_slam
