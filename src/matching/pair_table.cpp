#include "pair_table.h"

#include <algorithm>

namespace active_matching_slam {

int PairTable::acquire() {
  const auto free = std::find(used_.begin(), used_.end(), 0);
  const auto slot = static_cast<std::size_t>(free - used_.begin());
  if (slot >= static_cast<std::size_t>(kSlots)) return -1;
  if (free == used_.end()) {
    used_.push_back(0);
    rows_.emplace_back();
    for (auto& rows : rows_) rows.resize(used_.size());
  }
  used_[slot] = 1;
  for (std::size_t k = 0; k < used_.size(); ++k) {
    rows_[slot][k].clear();
    rows_[k][slot].clear();
  }
  return static_cast<int>(slot);
}

void PairTable::release(int slot) {
  if (slot >= 0) used_[static_cast<std::size_t>(slot)] = 0;
}

}  // namespace active_matching_slam
