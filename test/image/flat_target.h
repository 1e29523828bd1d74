#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/image/target_detector.h"

namespace active_matching_slam {

/// A sheet of paper with a target on it: 8-bit grey, and how large a pixel of it is.
struct PrintedTarget {
  cv::Mat picture;
  double metres_per_px;
};

inline PrintedTarget printTag(const TargetDescription& tag) {
  const cv::Mat black = drawTag(tag, 400);
  cv::Mat sheet(560, 560, CV_8UC1, cv::Scalar(220));
  cv::Mat scaled;
  black.convertTo(scaled, -1, 0.75, 25);
  scaled.copyTo(sheet({80, 80, 400, 400}));
  return {sheet, tag.size_m / 400};
}

inline PrintedTarget printChessboard(const TargetDescription& board) {
  constexpr int kSquare = 60;
  cv::Mat sheet((board.rows + 3) * kSquare, (board.columns + 3) * kSquare, CV_8UC1,
                cv::Scalar(220));
  for (int row = 0; row <= board.rows; ++row)
    for (int column = (row % 2); column <= board.columns; column += 2)
      sheet({(column + 1) * kSquare, (row + 1) * kSquare, kSquare, kSquare}).setTo(cv::Scalar(25));
  return {sheet, board.square_m / kSquare};
}

/// Draws the sheet into an image that a camera takes, nothing before it. `T_camera_sheet`: origin
/// in the sheet's middle, x right and y down on it.
inline void paste(const PrintedTarget& target, const CameraModel& camera,
                  const Eigen::Isometry3d& T_camera_sheet, cv::Mat* image) {
  constexpr int kSamples = 4;  // per axis of a pixel
  const double w = target.picture.cols * target.metres_per_px / 2;
  const double h = target.picture.rows * target.metres_per_px / 2;
  Eigen::AlignedBox2d box;
  for (const double x : {-w, w})
    for (const double y : {-h, h})
      if (const auto pixel = camera.project(T_camera_sheet * Eigen::Vector3d(x, y, 0)))
        box.extend(*pixel);
  if (box.isEmpty()) return;
  const Eigen::Vector3d normal = T_camera_sheet.linear().col(2);
  const Eigen::Isometry3d T_sheet_camera = T_camera_sheet.inverse();
  const int left = std::max(0, int(box.min().x()) - 1), top = std::max(0, int(box.min().y()) - 1);
  const int right = std::min(image->cols - 1, int(box.max().x()) + 1);
  const int bottom = std::min(image->rows - 1, int(box.max().y()) + 1);
  for (int v = top; v <= bottom; ++v) {
    for (int u = left; u <= right; ++u) {
      double sum = 0.0;
      for (int k = 0; k < kSamples * kSamples; ++k) {
        const Eigen::Vector2d at(u + (k % kSamples + 0.5) / kSamples - 0.5,
                                 v + (k / kSamples + 0.5) / kSamples - 0.5);
        sum += image->at<uchar>(v, u);
        const auto ray = camera.unproject(at);
        if (!ray || std::abs(ray->dot(normal)) < 1e-6) continue;
        const double depth = T_camera_sheet.translation().dot(normal) / ray->dot(normal);
        if (depth <= 0.0) continue;
        const Eigen::Vector3d point = T_sheet_camera * (depth * *ray);
        const int column = int(std::floor((point.x() + w) / target.metres_per_px));
        const int row = int(std::floor((point.y() + h) / target.metres_per_px));
        if (column < 0 || row < 0 || column >= target.picture.cols || row >= target.picture.rows)
          continue;
        sum += target.picture.at<uchar>(row, column) - double(image->at<uchar>(v, u));
      }
      image->at<uchar>(v, u) = cv::saturate_cast<uchar>(sum / (kSamples * kSamples));
    }
  }
}

inline TargetDescription exampleTag() {
  TargetDescription tag;
  tag.kind = TargetDescription::Kind::kTag;
  tag.dictionary = "tag36h11";
  tag.id = 7;
  tag.size_m = 0.25;
  return tag;
}

inline TargetDescription exampleChessboard() {
  TargetDescription board;
  board.kind = TargetDescription::Kind::kChessboard;
  board.columns = 6;
  board.rows = 4;
  board.square_m = 0.05;
  return board;
}

}  // namespace active_matching_slam
