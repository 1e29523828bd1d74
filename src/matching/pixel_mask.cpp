#include "active_matching_slam/matching/pixel_mask.h"

#include <algorithm>

namespace active_matching_slam {

void PixelMask::clear() {
  rows_.clear();
  history_.clear();
  first_v_ = 0;
  size_ = 0;
}

int PixelMask::insert(const PixelRun& run, std::vector<PixelRun>* added) {
  if (run.begin_u >= run.end_u) return 0;
  if (rows_.empty()) {
    first_v_ = run.v;
    rows_.resize(1);
  } else if (run.v < first_v_) {
    rows_.insert(rows_.begin(), static_cast<std::size_t>(first_v_ - run.v), {});
    first_v_ = run.v;
  } else if (run.v - first_v_ >= static_cast<int>(rows_.size())) {
    rows_.resize(static_cast<std::size_t>(run.v - first_v_) + 1);
  }
  std::vector<Interval>& row = rows_[static_cast<std::size_t>(run.v - first_v_)];
  // Intervals that touch or overlap the run are merged with it: [first, last).
  const auto first = std::partition_point(row.begin(), row.end(),
                                          [&](const Interval& i) { return i.end < run.begin_u; });
  auto last = first;
  Interval merged{run.begin_u, run.end_u};
  int cursor = run.begin_u;  // everything of the run left of it is accounted for
  int fresh = 0;
  const auto take = [&](int begin, int end) {
    if (begin >= end) return;
    fresh += end - begin;
    history_.push_back({run.v, begin, end});
    if (added) added->push_back({run.v, begin, end});
  };
  for (; last != row.end() && last->begin <= run.end_u; ++last) {
    take(cursor, std::min(last->begin, run.end_u));
    cursor = std::max(cursor, last->end);
    merged.begin = std::min(merged.begin, last->begin);
    merged.end = std::max(merged.end, last->end);
  }
  take(cursor, run.end_u);
  if (first == last) {
    row.insert(first, merged);
  } else {
    *first = merged;
    row.erase(first + 1, last);
  }
  size_ += fresh;
  return fresh;
}

int PixelMask::countMissing(const PixelRun& run) const {
  if (run.begin_u >= run.end_u) return 0;
  int missing = run.end_u - run.begin_u;
  if (run.v < first_v_ || run.v - first_v_ >= static_cast<int>(rows_.size())) return missing;
  const std::vector<Interval>& row = rows_[static_cast<std::size_t>(run.v - first_v_)];
  auto i = std::partition_point(row.begin(), row.end(),
                                [&](const Interval& k) { return k.end <= run.begin_u; });
  for (; i != row.end() && i->begin < run.end_u; ++i)
    missing -= std::min(i->end, run.end_u) - std::max(i->begin, run.begin_u);
  return missing;
}

bool PixelMask::contains(int u, int v) const { return countMissing({v, u, u + 1}) == 0; }

}  // namespace active_matching_slam
