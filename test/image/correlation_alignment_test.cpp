#include "../../src/image/correlation_alignment.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "textures.h"

namespace active_matching_slam {
namespace {

constexpr AlignmentEnd kUntilNothingIsGained{100, 1e-7};

cv::Mat smoothTexture(unsigned seed, double shift_u, double shift_v, double turn_deg) {
  cv::Mat image, smooth;
  WaveTexture(seed, 12.0).render(80, 60, shift_u, shift_v).convertTo(image, CV_32F);
  const cv::Mat turn = cv::getRotationMatrix2D({40.0f, 30.0f}, turn_deg, 1.0);
  cv::warpAffine(image, image, turn, image.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT);
  cv::GaussianBlur(image, smooth, {}, 2.0);
  return smooth;
}

cv::Point2d moved(const RigidWarp& warp, const cv::Point2d& p) {
  const double c = std::cos(warp.angle_rad), s = std::sin(warp.angle_rad);
  return {c * p.x - s * p.y + warp.u, s * p.x + c * p.y + warp.v};
}

TEST(AlignByCorrelation, EndsWhereOpencvsDoes) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const cv::Mat first = smoothTexture(seed, 0.0, 0.0, 0.0);
    const cv::Mat second = 0.7 * smoothTexture(seed, 1.5 - 0.2 * seed, -1.2, 2.0) + 20.0;
    cv::Mat expected = cv::Mat::eye(2, 3, CV_32F);
    const double correlation = cv::findTransformECC(
        first, second, expected, cv::MOTION_EUCLIDEAN,
        cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-7), cv::noArray(),
        1);
    RigidWarp warp;
    // OpenCV's is less by what it takes for black beyond the border.
    EXPECT_GT(alignByCorrelation(first, second, {}, kUntilNothingIsGained, &warp), correlation)
        << seed;
    for (const cv::Point2d p : {cv::Point2d(10, 10), cv::Point2d(70, 15), cv::Point2d(40, 50)}) {
      const cv::Mat_<float> e = expected;
      const cv::Point2d to(e(0, 0) * p.x + e(0, 1) * p.y + e(0, 2),
                           e(1, 0) * p.x + e(1, 1) * p.y + e(1, 2));
      EXPECT_LT(cv::norm(moved(warp, p) - to), 0.1) << seed;
    }
  }
}

TEST(AlignByCorrelation, LooksAtWhatIsUsedOnly) {
  const cv::Mat first = smoothTexture(3, 0.0, 0.0, 0.0);
  cv::Mat second = smoothTexture(3, 1.0, 0.5, 0.0);
  cv::Mat used(second.size(), CV_8U, cv::Scalar(255));
  const cv::Rect covered(20, 10, 40, 20);
  second(covered) = 255.0;
  used(cv::Rect(18, 8, 44, 24)) = 0;
  RigidWarp all, part;
  alignByCorrelation(first, second, {}, kUntilNothingIsGained, &all);
  EXPECT_GT(alignByCorrelation(first, second, used, kUntilNothingIsGained, &part), 0.98);
  const auto error = [](const RigidWarp& warp) {
    return cv::norm(moved(warp, {40, 30}) - cv::Point2d(39.0, 29.5));
  };
  EXPECT_LT(error(part), 0.1);
  EXPECT_GT(error(all), error(part));
}

TEST(AlignByCorrelation, OfFlatImagesLeadsNowhere) {
  const cv::Mat flat(60, 80, CV_32F, cv::Scalar(90));
  RigidWarp warp;
  EXPECT_EQ(0.0, alignByCorrelation(flat, flat, {}, kUntilNothingIsGained, &warp));
  RigidWarp outside;
  outside.u = 500.0;
  const cv::Mat first = smoothTexture(2, 0.0, 0.0, 0.0);
  EXPECT_EQ(0.0, alignByCorrelation(first, first, {}, kUntilNothingIsGained, &outside));
}

}  // namespace
}  // namespace active_matching_slam
