#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/simulation/scene.h"

namespace active_matching_slam {

/// Casts a ray through every pixel (through the lens model) onto the rectangles of a scene. Each
/// pixel is the mean of several rays that are spread over its area and over the exposure, filtered
/// from mip maps: no aliasing, no bias of edges. Immutable; the same poses give the same image, bit
/// for bit.
class Renderer {
 public:
  /// Rays of one image are spread over each pixel in a pattern of this many.
  static constexpr int kPattern = 4;
  /// Pose of the camera when sample `sample` of the image row `row` was exposed.
  using PoseOfRow = std::function<Eigen::Isometry3d(int sample, double row)>;

  /// `rolling`: every row pair has a pose of its own; otherwise all rows share one. Throws
  /// std::invalid_argument when a pixel of the camera can't be unprojected.
  Renderer(const CameraModel& camera, const Scene& scene, bool rolling = false);

  /// Light on the sensor, CV_32FC1 (1 = white at unit exposure; 0 where no surface is hit), the
  /// mean of `samples` (>= 1; a multiple of kPattern spreads evenly over the pixels). Reuses
  /// `radiance`.
  void render(const PoseOfRow& pose_of_row, int samples, cv::Mat& radiance) const;

  /// A sharp image from one pose.
  void render(const Eigen::Isometry3d& T_world_camera, cv::Mat& radiance) const;

 private:
  /// Light of a surface, in levels of halving size. Texels are bordered by one, so that
  /// interpolation needs no clamping.
  struct Texture {
    struct Level {
      std::vector<std::uint16_t> texels;
      int stride = 0;
      float scale_u = 1.0f, scale_v = 1.0f;  ///< texels of this level per texel of the first
    };
    std::vector<Level> levels;
    float columns = 0.0f, rows = 0.0f;
  };
  /// The three homogeneous coordinates of a ray's hit, linear in the ray: with ray d in the camera
  /// frame, w = d . inverse_depth, texel = (d . column / w, d . row / w).
  struct Plane {
    Eigen::Vector3f inverse_depth, column, row;
    int surface = -1;
  };

  /// Pixels [x0, x1) x [y0, y1) and the planes that may be seen in them.
  struct Tile {
    int x0, y0, x1, y1;
    int pattern;   ///< which rays of the pixels
    float weight;  ///< of a stored value
    bool covered;  ///< one plane, and nothing else is seen
    std::vector<const Plane*> planes;
    std::vector<std::array<float, 4>> lod;  ///< of each plane, at the corners
  };
  struct CornerRay {
    Eigen::Vector3f ray, per_u, per_v;  ///< bearing and its change per pixel
  };

  static Texture makeTexture(const cv::Mat& albedo);
  void buildRays(const CameraModel& camera);
  void planesSeenFrom(const Eigen::Isometry3d& T_world_camera, std::vector<Plane>& planes) const;
  void renderBand(const std::vector<Plane>& planes, int sample, int first_row, int last_row,
                  float weight, cv::Mat& radiance) const;
  /// Fills `tile.planes` and `tile.covered`.
  void sortOut(const std::vector<const Plane*>& candidates, Tile& tile) const;
  void renderTile(Tile& tile, cv::Mat& radiance) const;
  std::array<Eigen::Vector3f, 4> coneOf(int x0, int y0, int x1, int y1) const;
  float levelOfDetail(const Plane& plane, const CornerRay& corner) const;

  int width_ = 0, height_ = 0, tile_height_ = 0;
  std::vector<Surface> surfaces_;  ///< geometry only
  std::vector<Texture> textures_;
  std::array<cv::Mat, kPattern> rays_;  ///< CV_32FC1, three planes one below the other (x, y, z)
  cv::Mat border_rays_;                 ///< CV_32FC3, bearings of pixels -1 .. size
  std::vector<CornerRay> corners_;      ///< at the tiles' corners
  int corner_columns_ = 0;
};

}  // namespace active_matching_slam
