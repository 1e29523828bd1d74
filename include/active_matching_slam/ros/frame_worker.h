#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <mutex>
#include <optional>
#include <thread>

namespace active_matching_slam {

/// One thread that owns what it works on: newest item first and alone (an item that waits is
/// replaced by the next one and counted as dropped), and calls from other threads in between.
template <class Item>
class FrameWorker {
 public:
  explicit FrameWorker(std::function<void(const Item&)> process)
      : process_(std::move(process)), thread_([this] { run(); }) {}
  ~FrameWorker() { stop(); }
  FrameWorker(const FrameWorker&) = delete;
  FrameWorker& operator=(const FrameWorker&) = delete;

  /// Hands over an item; never waits for work.
  void post(Item item) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (stopped_) return;
      if (item_) ++dropped_;
      item_ = std::move(item);
    }
    wake_.notify_one();
  }

  /// Runs `task` in the thread, after the item in work and before the next, and waits for its end.
  /// Passes on what it throws. False when the worker has stopped. Not to be called from `process`.
  bool call(std::function<void()> task) {
    std::packaged_task<void()> packaged(std::move(task));
    std::future<void> done = packaged.get_future();
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (stopped_) return false;
      tasks_.push_back(std::move(packaged));
    }
    wake_.notify_one();
    try {
      done.get();
    } catch (const std::future_error&) {
      return false;  // stopped before its turn
    }
    return true;
  }

  /// Ends after the item in work; waiting calls return false. From then on post() is without
  /// effect.
  void stop() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopped_ = true;
      tasks_.clear();
    }
    wake_.notify_one();
    if (thread_.joinable()) thread_.join();
  }

  std::uint64_t dropped() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return dropped_;
  }

 private:
  void run() {
    for (;;) {
      std::packaged_task<void()> task;
      std::optional<Item> item;
      {
        std::unique_lock<std::mutex> lock(mutex_);
        wake_.wait(lock, [this] { return stopped_ || item_ || !tasks_.empty(); });
        if (stopped_) return;
        if (!tasks_.empty()) {
          task = std::move(tasks_.front());
          tasks_.pop_front();
        } else {
          item.swap(item_);
        }
      }
      if (task.valid())
        task();
      else
        process_(*item);
    }
  }

  std::function<void(const Item&)> process_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::packaged_task<void()>> tasks_;
  std::optional<Item> item_;
  std::uint64_t dropped_ = 0;
  bool stopped_ = false;
  std::thread thread_;  // last: starts when everything else is there
};

}  // namespace active_matching_slam
