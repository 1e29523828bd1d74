#include "active_matching_slam/ros/frame_worker.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace active_matching_slam {
namespace {

TEST(FrameWorker, WorksOnTheNewestItemAndCountsWhatItLeftBehind) {
  std::promise<void> first_started, go_on;
  std::vector<int> seen;
  FrameWorker<int> worker([&](const int& item) {
    seen.push_back(item);
    if (item != 1) return;
    first_started.set_value();
    go_on.get_future().wait();
  });
  worker.post(1);
  first_started.get_future().wait();
  for (int item = 2; item <= 10; ++item) worker.post(item);
  go_on.set_value();
  // Calls go before items, so the item that waits is done once two calls have been answered.
  while (true) {
    std::size_t count = 0;
    worker.call([&] { count = seen.size(); });
    if (count == 2) break;
  }
  EXPECT_EQ((std::vector<int>{1, 10}), seen);
  EXPECT_EQ(8u, worker.dropped());
}

TEST(FrameWorker, RunsCallsBetweenItemsAndPassesOnWhatTheyThrow) {
  FrameWorker<int> worker([](const int&) {});
  int answer = 0;
  EXPECT_TRUE(worker.call([&] { answer = 42; }));
  EXPECT_EQ(42, answer);
  EXPECT_THROW(worker.call([] { throw std::runtime_error("no"); }), std::runtime_error);
  EXPECT_TRUE(worker.call([] {})) << "and lives on";
}

TEST(FrameWorker, StopsInTheMiddleOfWorkAndRefusesMore) {
  std::atomic<int> count{0};
  FrameWorker<int> worker([&](const int&) { ++count; });
  std::thread source([&] {
    for (int i = 0; i < 10000; ++i) worker.post(i);
  });
  std::thread caller([&] {
    while (worker.call([] {})) {
    }
  });
  worker.stop();
  source.join();
  caller.join();
  const int counted = count;
  worker.post(1);
  EXPECT_FALSE(worker.call([] {}));
  EXPECT_EQ(counted, count);
}

}  // namespace
}  // namespace active_matching_slam
