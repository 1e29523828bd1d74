#include "active_matching_slam/map/map_monitor.h"

#include <algorithm>

namespace active_matching_slam {
namespace {

constexpr double kMajority = 0.5;  ///< Derivation: by definition, half of what should match
/// Sharpness of the mean one below which an image is blurred. Derivation: averaging two neighbours
/// leaves 2^(-1/2) of the mean difference of pixels whose differences are independent.
constexpr double kSharp = 0.7;
constexpr double kMemory = 0.1;  ///< Cost: weight of an image in the mean; of about ten

}  // namespace

/// Notes what is predicted, and returns the newest feature that is old enough.
FeatureId MapMonitor::newestJudged(double stamp_s, const std::vector<FeatureId>& predicted) {
  FeatureId newest = newest_.empty() ? -1 : newest_.back().id;
  for (const FeatureId id : predicted) newest = std::max(newest, id);
  newest_.push_back({stamp_s, newest});
  while (newest_.size() > 1 && stamp_s - newest_[1].stamp_s >= kPatienceS) newest_.pop_front();
  return newest_.front().id;
}

void MapMonitor::add(double stamp_s, const std::vector<FeatureId>& predicted,
                     const std::vector<FeatureId>& matched, double sharpness) {
  const FeatureId newest = newestJudged(stamp_s, predicted);
  const auto judged = [newest](const std::vector<FeatureId>& ids) {
    return static_cast<double>(
        std::count_if(ids.begin(), ids.end(), [newest](FeatureId id) { return id <= newest; }));
  };
  const bool is_good = judged(matched) >= kMajority * judged(predicted);
  if (is_good && last_stamp_s_ >= 0.0) right_s_ += stamp_s - last_stamp_s_;
  last_stamp_s_ = stamp_s;
  if (is_good) {
    sharpness_ += (sharpness_ > 0.0 ? kMemory : 1.0) * (sharpness - sharpness_);
    bad_since_s_ = -1.0;
  } else if (sharpness < kSharp * sharpness_) {
    bad_since_s_ = -1.0;  // nothing can be said
  } else if (bad_since_s_ < 0.0) {
    bad_since_s_ = stamp_s;
  }
  is_wrong_ = bad_since_s_ >= 0.0 && stamp_s - bad_since_s_ >= kPatienceS;
}

void MapMonitor::interrupt() {
  bad_since_s_ = last_stamp_s_ = -1.0;
  is_wrong_ = false;
}

}  // namespace active_matching_slam
