#include "active_matching_slam/rviz_panel/report_text.h"

#include <QStringList>
#include <algorithm>
#include <cmath>

namespace active_matching_slam {
namespace {

using ams_msgs::TrackingState;

const char* stateColor(int state) {
  switch (state) {
    case TrackingState::TRACKING:
      return "#2e7d32";
    case TrackingState::INITIALISING:
      return "#b26a00";
    case TrackingState::LOST:
      return "#c62828";
    default:
      return "#616161";
  }
}

bool isKnown(const TrackerReport& report) { return report.is_there && report.state; }

QString absenceText(const TrackerReport& report) {
  QString text = "no tracker at " + QString::fromStdString(report.tracker);
  QStringList others;
  for (const std::string& other : report.others)
    if (other != report.tracker) others << QString::fromStdString(other);
  return others.empty() ? text : text + "; there is one at " + others.join(", ");
}

QString reasonText(const TrackingState& state, double silence_s) {
  QString text = QString::fromStdString(state.reason.empty() ? state.quality_reason : state.reason);
  // A second is longer than the interval of any camera that can be tracked.
  if (silence_s > 1.0)
    text += QString("%1last image %2 s ago")
                .arg(text.isEmpty() ? "" : "; ")
                .arg(std::floor(silence_s), 0, 'f', 0);
  return text;
}

/// "1 loop", "2 loops".
QString countText(std::uint32_t count, const QString& thing) {
  return QString("%1 %2%3").arg(count).arg(thing, count == 1 ? "" : "s");
}

}  // namespace

const char* unknownStateColor() { return stateColor(-1); }

StateText stateText(const TrackerReport& report, const QString& typed) {
  StateText text;
  text.color = unknownStateColor();
  if (report.tracker.empty()) {
    text.name = "NO NAME";
    text.reason = QString("'%1' is no name of a tracker").arg(typed);
  } else if (!report.has_master) {
    text.name = "NO MASTER";
    text.reason = "the ROS master does not answer";
  } else if (!report.is_asked_for) {
    text.name = "...";
  } else if (!report.is_there) {
    text.name = "NO TRACKER";
    text.reason = absenceText(report);
  } else if (!report.state) {
    text.name = "WAITING";
    text.reason = "no image was tracked yet";
  } else {
    const TrackingState& state = *report.state;
    text.name = QString::fromStdString(state.state_name).toUpper();
    text.color = stateColor(state.state);
    text.reason = reasonText(state, report.silence_s);
    if (state.state == TrackingState::TRACKING && std::isfinite(state.quality))
      text.quality = state.quality;
  }
  return text;
}

QString scaleText(const TrackerReport& report) {
  if (!isKnown(report)) return "-";
  if (report.state->scale_source == TrackingState::SCALE_FREE)
    return "free: lengths are in map units";
  return "metres, from " +
         QString::fromStdString(report.state->scale_source_name).replace('_', ' ');
}

QString mapText(const TrackerReport& report) {
  if (!isKnown(report)) return "-";
  QStringList parts;
  if (report.statistics) parts << countText(report.statistics->features, "feature");
  if (report.state->map > 1) parts << QString("no. %1").arg(report.state->map);
  parts << QString("lost %1 times").arg(report.state->times_lost);
  parts << countText(report.state->resets, "reset");
  return parts.join(", ");
}

QString imageText(const TrackerReport& report) {
  if (!isKnown(report) || !report.statistics) return "-";
  const auto& statistics = *report.statistics;
  return QString("%1 of %2 matched by %3, %4 ms")
      .arg(statistics.matched)
      .arg(statistics.candidates)
      .arg(QString::fromStdString(statistics.matcher))
      .arg(statistics.total_ms, 0, 'f', 1);
}

QString laidAsideText(const TrackerReport& report) {
  if (!isKnown(report) || !report.statistics) return {};
  const auto& statistics = *report.statistics;
  if (statistics.submaps == 0 && statistics.submaps_found == 0) return {};
  QStringList parts;
  parts << QString("%1: %2, of which %3")
               .arg(countText(statistics.submaps, "submap"),
                    countText(statistics.frozen_features, "feature"),
                    countText(statistics.trunk_features, "separator"));
  parts << QString("%1 bit cut").arg(statistics.submap_lost_bits, 0, 'f', 0);
  if (statistics.submaps_found > 0)
    parts << QString("%1 found again").arg(statistics.submaps_found);
  if (statistics.loops > 0) parts << countText(statistics.loops, "loop");
  return parts.join("; ");
}

QString hierarchyText(const TrackerReport& report, bool is_asked_for) {
  if (!report.is_there || !report.submaps || report.submaps->levels.empty())
    return is_asked_for ? "none yet" : "not asked for";
  const auto& levels = report.submaps->levels;
  TrackerLink::Value value;
  int level = static_cast<int>(levels.size()) - 1;
  if (report.values && findValue(*report.values, "submap_level", &value))
    if (const auto* chosen = std::get_if<int>(&value)) level = std::clamp(*chosen, 0, level);
  const auto& shown = levels[static_cast<std::size_t>(level)];
  return QString("%1 of %2 at level %3 of 0 to %4, which keep %5 % of the information")
      .arg(countText(static_cast<std::uint32_t>(shown.submaps), "submap"))
      .arg(countText(static_cast<std::uint32_t>(report.submaps->ids.size()), "feature"))
      .arg(level)
      .arg(levels.size() - 1)
      .arg(100.0 * shown.preserved_chow_liu, 0, 'f', 0);
}

}  // namespace active_matching_slam
