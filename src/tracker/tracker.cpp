#include "active_matching_slam/tracker/tracker.h"

#include <chrono>
#include <cmath>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "active_matching_slam/image/image_quality.h"
#include "tracker_implementation.h"

namespace active_matching_slam {
namespace {

class StopWatch {
 public:
  /// Milliseconds since construction or the last call.
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
    return ms;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace

void Tracker::Implementation::setMask(const cv::Mat& used) {
  if (used.empty()) {
    mask_ = ImageMask();
    return;
  }
  if (used.cols != working_.givenWidth() || used.rows != working_.givenHeight()) {
    std::ostringstream fault;
    fault << "the mask is " << used.cols << " x " << used.rows << ", the calibration "
          << working_.givenWidth() << " x " << working_.givenHeight();
    throw std::invalid_argument(fault.str());
  }
  if (used.type() != CV_8UC1) throw std::invalid_argument("the mask is not 8-bit grey");
  mask_ = ImageMask(working_.reduce(used), options_.image);
}

void Tracker::Implementation::reset(const std::string& reason) {
  image_fixed_.reset();  // the time may be another
  is_pose_given_ = false;
  if (!options_.mapping && map_.size() > 0) {
    lookForCamera(reason);
    previous_image_.release();
    ++resets_;
    ++jumps_;
    return;
  }
  lost_maps_.clear();
  awaits_loaded_map_ = false;
  abandonMap(reason);
}

/// The next image begins another map. Those in which the camera was lost before are kept.
void Tracker::Implementation::abandonMap(const std::string& reason) {
  clearMap();
  state_ = TrackingState::kWaiting;
  reason_ = reason;
  map_number_ = maps_begun_++;
  ++resets_;
  ++jumps_;
}

void Tracker::Implementation::clearMap() {
  map_.clear();
  submaps_.clear();
  loop_witness_.clear();
  loop_undo_.reset();
  endLook();
  map_monitor_.reset();
  initialiser_.end();
  structure_.clear();
  structure_snapshot_ = {};
  filter_.reset(CameraState(), MotionCovariance::Zero());
  noise_.reset();
  motion_noise_.reset();
  quality_.reset();
  scale_source_ = ScaleSource::kFree;
  scale_fault_.clear();
  scale_finder_.reset();
  previous_image_.release();
  poor_frames_ = 0;
}

void Tracker::Implementation::setOptions(const TrackerOptions& options) {
  checkTrackerOptions(options);
  if (options.image.template_size_px != options_.image.template_size_px ||
      options.image.source_patch_size_px != options_.image.source_patch_size_px ||
      options.image.working_width != options_.image.working_width)
    throw std::invalid_argument(
        "image/template_size_px, image/source_patch_size_px and image/working_width can't change "
        "while a map is kept");
  cascade_.setOptions(options.matcher, options.cascade);
  filter_.setOptions(withTrustIn(camera_.calibration(), options.filter));
  noise_.setOptions(options.filter);
  motion_noise_.setOptions(options.filter);
  relocaliser_ = Relocaliser(options.relocaliser, options.map, options.image);
  endLook();
  submaps_.setOptions(options.submap_filter);
  options_ = options;
}

void Tracker::Implementation::setScale(double factor) {
  if (!(factor > 0.0) || !std::isfinite(factor))
    throw std::invalid_argument("scale factor = " + std::to_string(factor) + " is not positive");
  if (!options_.mapping) throw std::runtime_error("mapping is false: the map stays as it is");
  rescale(factor);
  scale_source_ = ScaleSource::kService;
}

void Tracker::Implementation::rescale(double factor) {
  filter_.rescale(factor);
  rescaleBesideFilter(factor);
}

/// All that has lengths but the filter's state.
void Tracker::Implementation::rescaleBesideFilter(double factor) {
  motion_noise_.rescale(factor);
  map_.rescale(factor);
  submaps_.rescale(factor);
  loop_witness_.clear();
  loop_undo_.reset();
  initialiser_.rescale(factor);
  T_world_reference_.translation() *= factor;
  endLook();
  scale_finder_.reset();
}

/// Refuses what can't be tracked, and says why.
bool Tracker::Implementation::accept(const cv::Mat& image, double stamp_s,
                                     const std::string& why_empty, TrackedFrame* frame) {
  std::ostringstream fault;
  if (image.empty()) {
    fault << (why_empty.empty() ? "the image is empty" : why_empty);
  } else if (image.type() != CV_8UC1) {
    fault << "the image is not 8-bit grey";
  } else if (image.cols != working_.givenWidth() || image.rows != working_.givenHeight()) {
    fault << "the image is " << image.cols << " x " << image.rows << ", the calibration "
          << working_.givenWidth() << " x " << working_.givenHeight();
  } else if (!std::isfinite(stamp_s)) {
    fault << "the stamp is not a finite number";
  } else if (state_ != TrackingState::kWaiting && stamp_s < last_stamp_s_ - kClockStep_s) {
    std::ostringstream reason;
    reason << "the stamp ran back by " << last_stamp_s_ - stamp_s << " s: started anew";
    reset(reason.str());
    state_stamp_s_ = stamp_s;
    frame->reason = reason.str();
    return true;
  } else if (state_ != TrackingState::kWaiting && stamp_s < last_stamp_s_) {
    ++late_images_;
    fault << "it is late, one with a later stamp came before it";
  } else if (state_ != TrackingState::kWaiting && stamp_s == last_stamp_s_) {
    fault << "the stamp equals the one before";
  } else {
    return true;
  }
  frame->reason = "image ignored: " + fault.str();
  return false;
}

/// The usual way of an image, once the state is predicted.
FrameState Tracker::Implementation::follow(const cv::Mat& image, double interval_s,
                                           TrackedFrame* frame) {
  StopWatch stage;
  FrameState current = measure(image, interval_s);
  frame->timings_ms.measure = stage.lap();
  if (options_.structure) observeStructure(current.visible);
  frame->timings_ms.structure = stage.lap();
  cascade_.match(options_.matching, options_.fallback_matchers, &current);
  frame->timings_ms.match = stage.lap();
  correct(&current, frame);
  const bool is_restarted = initialise(current, frame);
  frame->timings_ms.update = stage.lap();
  if (is_restarted || leaveOutImageFixed(current, frame) || giveUpWrongMap(current, frame))
    return current;
  updateTrackingState(current);
  findScale(frame);
  scaleByGround(frame);
  if (watchLoop(frame)) return current;
  retakePatches(current);
  lookForLoop(image, interval_s, frame);
  maintainMap(image, frame);
  followTarget(image, frame);
  frame->timings_ms.map = stage.lap();
  if (options_.structure) updateStructure(frame);
  frame->timings_ms.structure += stage.lap();
  return current;
}

std::shared_ptr<const TrackedFrame> Tracker::Implementation::track(const cv::Mat& given,
                                                                   double stamp_s,
                                                                   const std::string& fault) {
  auto frame = std::make_shared<TrackedFrame>();
  StopWatch total, stage;
  frame->stamp_s = stamp_s;
  frame->index = images_++;
  if (!accept(given, stamp_s, fault, frame.get())) {
    frame->state = state_;
    describeState(frame.get());
    return frame;
  }
  const cv::Mat image = working_.reduce(given);
  camera_ = camera_.corrected(filter_.camera().lens);
  frame->image = image;
  frame->mask = mask_.used();
  const cv::Mat used = mask_.applyTo(image);
  frame->repeated_image = !previous_image_.empty() && isRepeatedImage(used, previous_image_);
  const double before_s = std::exchange(last_stamp_s_, stamp_s);
  motion_.reset();
  motion_fault_.clear();

  std::optional<FrameState> current;
  if (state_ == TrackingState::kWaiting || state_ == TrackingState::kInitialising) {
    start(used, frame.get());
    state_stamp_s_ = stamp_s;
  } else if (state_ == TrackingState::kLost) {
    const double interval_s = stamp_s - state_stamp_s_;
    state_stamp_s_ = stamp_s;
    predict(interval_s);
    if (!is_pose_given_ || !findNearGivenPose(used, interval_s, frame.get()))
      relocaliseWhileLost(used, interval_s, frame.get());
  } else if (!frame->repeated_image) {
    const double interval_s = stamp_s - state_stamp_s_;
    state_stamp_s_ = stamp_s;
    predict(interval_s);
    frame->timings_ms.predict = stage.lap();
    // Over a long gap, or when too little has matched for a while, the prediction is next to
    // worthless: the whole image is searched for the map first. A gap has left time for all of it.
    const bool is_gap = interval_s > options_.max_frame_interval_s && !isTranslationKnown();
    if (is_gap) endLook();
    const bool is_due = is_gap || poor_frames_ >= kRelocalisationPeriodFrames;
    if (!is_due || !lookWhileLost(used, is_gap ? LookBudget::kWhole : LookBudget::kHalf, interval_s,
                                  frame.get()))
      current.emplace(follow(used, interval_s, frame.get()));
  }
  previous_image_ = mask_.isWhole() ? image.clone() : used;  // the caller may reuse its memory
  if (poor_frames_ == 0) {
    reference_image_ = previous_image_;
    reference_index_ = frame->index;
  }
  forgetOldMaps();
  if (lookForOtherMaps(used, stamp_s - before_s, frame.get())) current.reset();
  frame->state = state_;
  // Where not even the second image knew the first, the third one's origin is a claim of nothing.
  if (current && state_ == TrackingState::kTracking && unrelated_images_ > 1) {
    frame->state = TrackingState::kInitialising;
    frame->reason =
        "no image has to do with the one before: two cameras on one topic, or too few a second?";
  }
  if (!reason_.empty()) frame->reason = reason_;
  describeState(frame.get());
  if (current) describeMatches(std::move(*current), frame.get());
  frame->timings_ms.total = total.lap();
  return frame;
}

Tracker::Tracker(const CameraModel& camera, const TrackerOptions& options)
    : implementation_(std::make_unique<Implementation>(camera, options)) {}
Tracker::~Tracker() = default;
std::shared_ptr<const TrackedFrame> Tracker::track(const cv::Mat& image, double stamp_s,
                                                   const std::string& fault) {
  return implementation_->track(image, stamp_s, fault);
}
void Tracker::setMask(const cv::Mat& used) { implementation_->setMask(used); }
void Tracker::setMotionHistory(std::shared_ptr<const MotionHistory> history) {
  implementation_->setMotionHistory(std::move(history));
}
void Tracker::setPose(const Eigen::Isometry3d& T_world_camera,
                      const Eigen::Matrix<double, 6, 6>& covariance) {
  implementation_->setPose(T_world_camera, covariance);
}
void Tracker::reset(const std::string& reason) { implementation_->reset(reason); }
const TrackerOptions& Tracker::options() const { return implementation_->options(); }
void Tracker::setOptions(const TrackerOptions& options) { implementation_->setOptions(options); }
void Tracker::setScale(double factor) { implementation_->setScale(factor); }
void Tracker::saveMap(const std::string& path) const { implementation_->saveMap(path); }
void Tracker::loadMap(const std::string& path) { implementation_->loadMap(path); }

}  // namespace active_matching_slam
