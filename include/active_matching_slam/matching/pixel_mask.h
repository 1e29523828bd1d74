#pragma once

#include <cstdint>
#include <vector>

namespace active_matching_slam {

/// A horizontal run of pixels, begin_u included, end_u excluded.
struct PixelRun {
  int v = 0;
  int begin_u = 0;
  int end_u = 0;
};

/// A set of pixels, kept as sorted, disjoint, maximal runs per row. Rows grow in both directions as
/// pixels are added; coordinates may be negative.
class PixelMask {
 public:
  void clear();
  /// Adds a run; appends to `added` (when given) the parts that were not in the set before.
  /// Returns how many pixels were new.
  int insert(const PixelRun& run, std::vector<PixelRun>* added = nullptr);
  /// How many pixels of the run are not in the set.
  int countMissing(const PixelRun& run) const;
  bool contains(int u, int v) const;
  std::int64_t size() const { return size_; }
  /// The same pixels as disjoint runs in the order in which they were added.
  const std::vector<PixelRun>& history() const { return history_; }

  /// Calls f(const PixelRun&) for every run, by row then column.
  template <typename F>
  void forEachRun(F f) const {
    for (std::size_t row = 0; row < rows_.size(); ++row)
      for (const Interval& i : rows_[row])
        f(PixelRun{first_v_ + static_cast<int>(row), i.begin, i.end});
  }

 private:
  struct Interval {
    int begin, end;
  };
  int first_v_ = 0;
  std::vector<std::vector<Interval>> rows_;
  std::vector<PixelRun> history_;
  std::int64_t size_ = 0;
};

}  // namespace active_matching_slam
