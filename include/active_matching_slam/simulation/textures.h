#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace active_matching_slam {

/// What a procedural texture is painted on: a rectangle of `width_m` x `height_m`.
struct Canvas {
  double width_m = 1.0;
  double height_m = 1.0;
  double texels_per_m = 400.0;
  std::uint64_t seed = 1;

  cv::Size size() const;
};

// Every painter returns reflectance in [0, 1], CV_32FC1, of canvas.size(). Lengths are real, so
// neighbouring surfaces fit together.

// Materials (textures_materials.cpp).
cv::Mat paintPlain(const Canvas& canvas, double level, double grain = 0.02);
cv::Mat paintPlaster(const Canvas& canvas, double level);
cv::Mat paintConcrete(const Canvas& canvas);
cv::Mat paintBricks(const Canvas& canvas);
cv::Mat paintTiles(const Canvas& canvas, double tile_m, double level);
cv::Mat paintWood(const Canvas& canvas, double level, double plank_m = 0.0);
cv::Mat paintFabric(const Canvas& canvas, double level);
cv::Mat paintCarpet(const Canvas& canvas);
cv::Mat paintStone(const Canvas& canvas, double cell_m);
cv::Mat paintFoliage(const Canvas& canvas);
cv::Mat paintGrass(const Canvas& canvas);
cv::Mat paintSky(const Canvas& canvas);

// Things with figures on them (textures_printed.cpp).
cv::Mat paintWallpaper(const Canvas& canvas);
cv::Mat paintPoster(const Canvas& canvas);
cv::Mat paintPage(const Canvas& canvas);
cv::Mat paintBookSpines(const Canvas& canvas);
cv::Mat paintBookCover(const Canvas& canvas);
cv::Mat paintKeyboard(const Canvas& canvas);
cv::Mat paintScreen(const Canvas& canvas);
cv::Mat paintCalendar(const Canvas& canvas);
cv::Mat paintCorkBoard(const Canvas& canvas);
cv::Mat paintPackage(const Canvas& canvas);
cv::Mat paintWindow(const Canvas& canvas);
cv::Mat paintLandscape(const Canvas& canvas);
cv::Mat paintFacade(const Canvas& canvas);
cv::Mat paintDoor(const Canvas& canvas);
/// Squares of `square_m`, the first black, from the top left corner.
cv::Mat paintCheckerboard(const Canvas& canvas, double square_m);

/// Adds smooth noise with features of about cell_u_m x cell_v_m and the given standard deviation.
void addNoise(cv::Mat& image, double texels_per_m, double cell_u_m, double cell_v_m, double sigma,
              std::uint64_t seed);

}  // namespace active_matching_slam
