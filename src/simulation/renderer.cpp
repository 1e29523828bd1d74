#include "active_matching_slam/simulation/renderer.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

namespace active_matching_slam {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr int kTile = 16;         ///< side of the areas for which surfaces are sorted out
constexpr int kBlock = 8;         ///< tiles a side of the areas sorted out first
constexpr float kUnit = 8192.0f;  ///< stored value of radiance 1
/// A rotated grid: its rays have four different offsets in u and in v. Taken in turn over the
/// exposure, first and last are opposite, and so on inwards: motion smears a point evenly to both
/// sides of where it is in the middle of the exposure, whichever way it moves.
constexpr double kPatternU[] = {-0.125, 0.375, -0.375, 0.125};
constexpr double kPatternV[] = {-0.375, -0.125, 0.125, 0.375};

Vector3d bearing(const CameraModel& camera, double u, double v) {
  const auto ray = camera.unproject(Vector2d(u, v));
  if (!ray)
    throw std::invalid_argument("calibration: pixel (" + std::to_string(u) + ", " +
                                std::to_string(v) + ") can't be unprojected");
  return *ray;
}

/// What a tile's cone of rays means for a plane's rectangle. Every test is linear in the ray, so
/// the four edges of the cone decide for all rays within.
struct Coverage {
  bool missed = false, covered = false;
  float nearest = 0.0f, farthest = 0.0f;  ///< inverse depth
};

template <typename Plane>
Coverage coverage(const Plane& plane, float columns, float rows,
                  const std::array<Vector3f, 4>& cone) {
  int below[5] = {0, 0, 0, 0, 0};
  Coverage result;
  for (int i = 0; i < 4; ++i) {
    const float w = plane.inverse_depth.dot(cone[i]);
    const float a = plane.column.dot(cone[i]), b = plane.row.dot(cone[i]);
    below[0] += w <= 0.0f;
    below[1] += a < 0.0f;
    below[2] += columns * w < a;
    below[3] += b < 0.0f;
    below[4] += rows * w < b;
    result.nearest = i == 0 ? w : std::max(result.nearest, w);
    result.farthest = i == 0 ? w : std::min(result.farthest, w);
  }
  result.covered = true;
  for (int count : below) {
    result.missed |= count == 4;
    result.covered &= count == 0;
  }
  return result;
}

/// What the rays of a row of a tile have met so far. Plain arrays of one type, so that the loops
/// below become vector code.
struct Hits {
  float nearest[kTile], column[kTile], row[kTile];
  int plane[kTile];  ///< index, -1 for none
  Hits() {
    std::fill_n(nearest, kTile, 0.0f);
    std::fill_n(plane, kTile, -1);
  }
};

/// Every ray meets the plane inside its rectangle.
template <typename Plane>
void meetPlane(const Plane& plane, const float* rx, const float* ry, const float* rz, int n,
               Hits& hits) {
  const Vector3f w = plane.inverse_depth, a = plane.column, b = plane.row;
  for (int i = 0; i < n; ++i) {
    hits.nearest[i] = w[0] * rx[i] + w[1] * ry[i] + w[2] * rz[i];
    hits.column[i] = a[0] * rx[i] + a[1] * ry[i] + a[2] * rz[i];
    hits.row[i] = b[0] * rx[i] + b[1] * ry[i] + b[2] * rz[i];
    hits.plane[i] = 0;
  }
}

/// Replaces what lies farther than the rectangle.
template <typename Plane>
void meetRectangle(const Plane& plane, float columns, float rows, int index, const float* rx,
                   const float* ry, const float* rz, int n, Hits& hits) {
  const Vector3f pw = plane.inverse_depth, pa = plane.column, pb = plane.row;
  for (int i = 0; i < n; ++i) {
    const float w = pw[0] * rx[i] + pw[1] * ry[i] + pw[2] * rz[i];
    const float a = pa[0] * rx[i] + pa[1] * ry[i] + pa[2] * rz[i];
    const float b = pb[0] * rx[i] + pb[1] * ry[i] + pb[2] * rz[i];
    // The least distance to a border: positive inside.
    const float side = std::min(std::min(a, columns * w - a), std::min(b, rows * w - b));
    const float nearer = side >= 0.0f ? w : 0.0f;
    if (!(nearer > hits.nearest[i])) continue;
    hits.nearest[i] = w;
    hits.column[i] = a;
    hits.row[i] = b;
    hits.plane[i] = index;
  }
}

float bilinear(const std::uint16_t* texels, int stride, float u, float v) {
  const int iu = static_cast<int>(u), iv = static_cast<int>(v);
  const float fu = u - static_cast<float>(iu), fv = v - static_cast<float>(iv);
  const std::uint16_t* p = texels + static_cast<std::ptrdiff_t>(iv) * stride + iu;
  const float top = p[0] + fu * (p[1] - p[0]);
  const float bottom = p[stride] + fu * (p[stride + 1] - p[stride]);
  return top + fv * (bottom - top);
}

/// `u`, `v` in texels of the first level, from the corner of the texture; `lod` within the levels.
template <typename Texture>
float sampleTexture(const Texture& texture, float u, float v, float lod) {
  const int level = static_cast<int>(lod);
  const float fraction = lod - static_cast<float>(level);
  u = std::min(std::max(u, 0.0f), texture.columns);
  v = std::min(std::max(v, 0.0f), texture.rows);
  const auto& fine = texture.levels[level];
  // Texel centres are at halves, and the border shifts by one.
  const float value =
      bilinear(fine.texels.data(), fine.stride, u * fine.scale_u + 0.5f, v * fine.scale_v + 0.5f);
  if (fraction <= 0.0f) return value;
  const auto& coarse = texture.levels[level + 1];
  return value + fraction * (bilinear(coarse.texels.data(), coarse.stride,
                                      u * coarse.scale_u + 0.5f, v * coarse.scale_v + 0.5f) -
                             value);
}

}  // namespace

Renderer::Renderer(const CameraModel& camera, const Scene& scene, bool rolling)
    : width_(camera.width()), height_(camera.height()), tile_height_(rolling ? 2 : kTile) {
  checkScene(scene);
  for (const Surface& surface : scene.surfaces) {
    textures_.push_back(makeTexture(surface.albedo));
    surfaces_.push_back(surface);
    surfaces_.back().albedo.release();
  }
  buildRays(camera);
}

Renderer::Texture Renderer::makeTexture(const cv::Mat& albedo) {
  Texture texture;
  texture.columns = static_cast<float>(albedo.cols);
  texture.rows = static_cast<float>(albedo.rows);
  cv::Mat level = albedo;
  for (;;) {
    cv::Mat stored, bordered;
    level.convertTo(stored, CV_16UC1, kUnit);
    // One texel before, two after: a coordinate on the far edge reads one beyond with weight 0.
    cv::copyMakeBorder(stored, bordered, 1, 2, 1, 2, cv::BORDER_REPLICATE);
    Texture::Level out;
    out.stride = bordered.cols;
    out.texels.assign(bordered.begin<std::uint16_t>(), bordered.end<std::uint16_t>());
    out.scale_u = static_cast<float>(level.cols) / texture.columns;
    out.scale_v = static_cast<float>(level.rows) / texture.rows;
    texture.levels.push_back(std::move(out));
    if (level.cols <= 2 && level.rows <= 2) return texture;
    cv::Mat smaller;
    cv::resize(level, smaller,
               cv::Size(std::max(1, (level.cols + 1) / 2), std::max(1, (level.rows + 1) / 2)), 0, 0,
               cv::INTER_AREA);
    level = smaller;
  }
}

void Renderer::buildRays(const CameraModel& camera) {
  for (int k = 0; k < kPattern; ++k) {
    rays_[k].create(3 * height_, width_, CV_32FC1);
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x) {
        const Vector3d ray = bearing(camera, x + kPatternU[k], y + kPatternV[k]);
        for (int axis = 0; axis < 3; ++axis)
          rays_[k].at<float>(axis * height_ + y, x) = static_cast<float>(ray[axis]);
      }
  }
  border_rays_.create(height_ + 2, width_ + 2, CV_32FC3);
  for (int y = 0; y < height_ + 2; ++y)
    for (int x = 0; x < width_ + 2; ++x) {
      const Vector3f ray = bearing(camera, x - 1, y - 1).cast<float>();
      border_rays_.at<cv::Vec3f>(y, x) = {ray.x(), ray.y(), ray.z()};
    }
  corner_columns_ = (width_ + kTile - 1) / kTile + 1;
  const int corner_rows = (height_ + tile_height_ - 1) / tile_height_ + 1;
  for (int j = 0; j < corner_rows; ++j)
    for (int i = 0; i < corner_columns_; ++i) {
      const double u = std::min(i * kTile, width_) - 0.5;
      const double v = std::min(j * tile_height_, height_) - 0.5;
      CornerRay corner;
      corner.ray = bearing(camera, u, v).cast<float>();
      corner.per_u = (bearing(camera, u + 0.5, v) - bearing(camera, u - 0.5, v)).cast<float>();
      corner.per_v = (bearing(camera, u, v + 0.5) - bearing(camera, u, v - 0.5)).cast<float>();
      corners_.push_back(corner);
    }
}

void Renderer::planesSeenFrom(const Isometry3d& T_world_camera, std::vector<Plane>& planes) const {
  planes.clear();
  const Eigen::Matrix3d R_camera_world = T_world_camera.linear().transpose();
  for (std::size_t i = 0; i < surfaces_.size(); ++i) {
    const Surface& s = surfaces_[i];
    const Vector3d offset = T_world_camera.translation() - s.origin;
    const Vector3d normal = s.normal();
    const double height = normal.dot(offset);
    if (height <= 1e-6) continue;  // seen from behind
    const Vector3d inverse_depth = -normal / height;
    const Texture& texture = textures_[i];
    Plane plane;
    plane.surface = static_cast<int>(i);
    plane.inverse_depth = (R_camera_world * inverse_depth).cast<float>();
    plane.column = (R_camera_world * (s.u_axis + s.u_axis.dot(offset) * inverse_depth) *
                    (texture.columns / s.width_m))
                       .cast<float>();
    plane.row = (R_camera_world * (s.v_axis + s.v_axis.dot(offset) * inverse_depth) *
                 (texture.rows / s.height_m))
                    .cast<float>();
    planes.push_back(plane);
  }
}

std::array<Vector3f, 4> Renderer::coneOf(int x0, int y0, int x1, int y1) const {
  // One pixel wider than the pixels' centres: rays are spread over each pixel.
  const auto ray = [this](int x, int y) {
    const cv::Vec3f& r = border_rays_.at<cv::Vec3f>(y + 1, x + 1);
    return Vector3f(r[0], r[1], r[2]);
  };
  return {ray(x0 - 1, y0 - 1), ray(x1, y0 - 1), ray(x1, y1), ray(x0 - 1, y1)};
}

void Renderer::render(const Isometry3d& T_world_camera, cv::Mat& radiance) const {
  render([&T_world_camera](int, double) { return T_world_camera; }, kPattern, radiance);
}

void Renderer::render(const PoseOfRow& pose_of_row, int samples, cv::Mat& radiance) const {
  radiance.create(height_, width_, CV_32FC1);
  radiance.setTo(cv::Scalar(0.0));
  const float weight = 1.0f / (kUnit * static_cast<float>(samples));
  const bool rolling = tile_height_ != kTile;
  const int band = rolling ? tile_height_ : height_;
  std::vector<Plane> planes;
  for (int sample = 0; sample < samples; ++sample)
    for (int row = 0; row < height_; row += band) {
      const int last = std::min(row + band, height_);
      planesSeenFrom(pose_of_row(sample, 0.5 * (row + last - 1)), planes);
      renderBand(planes, sample % kPattern, row, last, weight, radiance);
    }
}

void Renderer::renderBand(const std::vector<Plane>& planes, int pattern, int first_row,
                          int last_row, float weight, cv::Mat& radiance) const {
  std::vector<const Plane*> in_block;
  Tile tile;
  tile.pattern = pattern;
  tile.weight = weight;
  const int block_width = kBlock * kTile, block_height = kBlock * tile_height_;
  for (int by = first_row; by < last_row; by += block_height)
    for (int bx = 0; bx < width_; bx += block_width) {
      const int bx1 = std::min(bx + block_width, width_),
                by1 = std::min(by + block_height, last_row);
      const auto block_cone = coneOf(bx, by, bx1, by1);
      in_block.clear();
      for (const Plane& plane : planes) {
        const Texture& t = textures_[plane.surface];
        if (!coverage(plane, t.columns, t.rows, block_cone).missed) in_block.push_back(&plane);
      }
      for (tile.y0 = by; tile.y0 < by1; tile.y0 += tile_height_)
        for (tile.x0 = bx; tile.x0 < bx1; tile.x0 += kTile) {
          tile.x1 = std::min(tile.x0 + kTile, width_);
          tile.y1 = std::min(tile.y0 + tile_height_, last_row);
          sortOut(in_block, tile);
          if (!tile.planes.empty()) renderTile(tile, radiance);
        }
    }
}

void Renderer::sortOut(const std::vector<const Plane*>& candidates, Tile& tile) const {
  const auto cone = coneOf(tile.x0, tile.y0, tile.x1, tile.y1);
  tile.planes.clear();
  float wall = 0.0f;  // inverse depth behind which nothing is seen
  const auto coverageOf = [&](const Plane* plane) {
    const Texture& t = textures_[plane->surface];
    return coverage(*plane, t.columns, t.rows, cone);
  };
  for (const Plane* plane : candidates) {
    const Coverage c = coverageOf(plane);
    if (c.missed || c.nearest < wall) continue;
    if (c.covered) wall = std::max(wall, c.farthest);
    tile.planes.push_back(plane);
  }
  // Those found before the wall that hides them.
  tile.planes.erase(
      std::remove_if(tile.planes.begin(), tile.planes.end(),
                     [&](const Plane* plane) { return coverageOf(plane).nearest < wall; }),
      tile.planes.end());
  tile.covered = tile.planes.size() == 1 && coverageOf(tile.planes[0]).covered;
}

float Renderer::levelOfDetail(const Plane& plane, const CornerRay& corner) const {
  const Texture& texture = textures_[plane.surface];
  const float last = static_cast<float>(texture.levels.size() - 1);
  const float w = plane.inverse_depth.dot(corner.ray);
  if (w <= 1e-6f) return last;
  const float s = plane.column.dot(corner.ray) / w, t = plane.row.dot(corner.ray) / w;
  const auto change = [&](const Vector3f& numerator, float value, const Vector3f& step) {
    return (numerator.dot(step) - value * plane.inverse_depth.dot(step)) / w;
  };
  const float su = change(plane.column, s, corner.per_u),
              sv = change(plane.column, s, corner.per_v);
  const float tu = change(plane.row, t, corner.per_u), tv = change(plane.row, t, corner.per_v);
  // Singular values of the pixel's footprint in texels.
  const float sum = su * su + sv * sv + tu * tu + tv * tv;
  const float area = std::abs(su * tv - sv * tu);
  const float root = std::sqrt(std::max(sum * sum - 4.0f * area * area, 0.0f));
  const float longest = std::sqrt(0.5f * (sum + root));
  // Four rays a pixel share its area, so each needs only a part filtered. A long footprint is
  // filtered up to a third of its length: between the blur of its length and the aliasing of its
  // width.
  const float filter = std::max(0.6f * std::sqrt(area), 0.35f * longest);
  return std::clamp(std::log2(std::max(filter, 1e-6f)), 0.0f, last);
}

void Renderer::renderTile(Tile& tile, cv::Mat& radiance) const {
  const int x0 = tile.x0, y0 = tile.y0, x1 = tile.x1, y1 = tile.y1;
  const int corner = (y0 / tile_height_) * corner_columns_ + x0 / kTile;
  tile.lod.clear();
  for (const Plane* plane : tile.planes)
    tile.lod.push_back({levelOfDetail(*plane, corners_[corner]),
                        levelOfDetail(*plane, corners_[corner + 1]),
                        levelOfDetail(*plane, corners_[corner + corner_columns_]),
                        levelOfDetail(*plane, corners_[corner + corner_columns_ + 1])});
  const int n = x1 - x0;
  for (int y = y0; y < y1; ++y) {
    const float* rx = rays_[tile.pattern].ptr<float>(y) + x0;
    const float* ry = rays_[tile.pattern].ptr<float>(height_ + y) + x0;
    const float* rz = rays_[tile.pattern].ptr<float>(2 * height_ + y) + x0;
    Hits hits;
    if (tile.covered) {
      meetPlane(*tile.planes[0], rx, ry, rz, n, hits);
    } else {
      for (std::size_t k = 0; k < tile.planes.size(); ++k) {
        const Texture& texture = textures_[tile.planes[k]->surface];
        meetRectangle(*tile.planes[k], texture.columns, texture.rows, static_cast<int>(k), rx, ry,
                      rz, n, hits);
      }
    }
    float* out = radiance.ptr<float>(y) + x0;
    const float down = (static_cast<float>(y - y0) + 0.5f) / static_cast<float>(y1 - y0);
    const float step = 1.0f / static_cast<float>(n);
    for (int i = 0; i < n; ++i) {
      const int hit = hits.plane[i];
      if (hit < 0) continue;
      const std::array<float, 4>& l = tile.lod[hit];
      const float left = l[0] + down * (l[2] - l[0]), right = l[1] + down * (l[3] - l[1]);
      const float inverse = 1.0f / hits.nearest[i];
      out[i] += tile.weight * sampleTexture(textures_[tile.planes[hit]->surface],
                                            hits.column[i] * inverse, hits.row[i] * inverse,
                                            left + (i + 0.5f) * step * (right - left));
    }
  }
}

}  // namespace active_matching_slam
