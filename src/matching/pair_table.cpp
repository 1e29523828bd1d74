#include "pair_table.h"

#include <algorithm>

namespace active_matching_slam {

int PairTable::acquire() {
  const auto free = std::find(users_.begin(), users_.end(), 0);
  const auto entry = static_cast<std::size_t>(free - users_.begin());
  if (entry >= static_cast<std::size_t>(kMost)) return kNone;
  if (free == users_.end()) {
    users_.push_back(0);
    serials_.push_back(0);
    own_.emplace_back();
  }
  if (users_.size() > stride_) grow();
  users_[entry] = 1;
  serials_[entry] = ++last_serial_;
  own_[entry].null = PairTerm::kUnknown;
  for (std::size_t other = 0; other < users_.size(); ++other) {
    terms_[entry * stride_ + other].mass = terms_[entry * stride_ + other].null =
        PairTerm::kUnknown;
    terms_[other * stride_ + entry].mass = terms_[other * stride_ + entry].null =
        PairTerm::kUnknown;
  }
  return static_cast<int>(entry);
}

void PairTable::grow() {
  const std::size_t next = std::max<std::size_t>(4, 2 * stride_);
  std::vector<PairTerm> terms(next * next);
  for (std::size_t row = 0; row < stride_; ++row)
    std::copy_n(&terms_[row * stride_], stride_, &terms[row * next]);
  terms_ = std::move(terms);
  stride_ = next;
}

}  // namespace active_matching_slam
