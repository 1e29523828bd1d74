#pragma once

#include <gtest/gtest.h>

#include <cstdlib>

#include "support/recorded_data.h"

namespace active_matching_slam {
namespace test {

/// Suites that track for minutes, which are skipped unless the environment has AMS_ACCURACY. Their
/// names begin with Long.
class LongRuns : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::getenv("AMS_ACCURACY")) GTEST_SKIP() << "skipped: AMS_ACCURACY is not set";
  }
};

class RecordedRuns : public testing::Test {
 protected:
  void SetUp() override {
    if (recordedDataFolder().empty()) GTEST_SKIP() << "skipped: AMS_DATA is not set";
  }
};

class LongRecordedRuns : public LongRuns {
 protected:
  void SetUp() override {
    LongRuns::SetUp();
    if (recordedDataFolder().empty()) GTEST_SKIP() << "skipped: AMS_DATA is not set";
  }
};

}  // namespace test
}  // namespace active_matching_slam
