#pragma once

#include <QString>
#include <optional>

#include "active_matching_slam/rviz_panel/tracker_link.h"

namespace active_matching_slam {

/// What the panel says of a tracker's state.
struct StateText {
  QString name, reason;
  const char* color = "";         ///< behind the name
  std::optional<double> quality;  ///< of the poses; none where no pose is claimed
};

/// `typed`: the tracker's name as the user wrote it.
StateText stateText(const TrackerReport& report, const QString& typed);
/// The colour of a state that nothing is known of.
const char* unknownStateColor();

/// These are "-" where nothing is known.
QString scaleText(const TrackerReport& report);
QString mapText(const TrackerReport& report);
QString imageText(const TrackerReport& report);

/// Submaps that are laid aside (submaps/enabled); empty: there were none.
QString laidAsideText(const TrackerReport& report);

/// The hierarchy of the active map at the level that is shown; `is_asked_for`: by this panel.
QString hierarchyText(const TrackerReport& report, bool is_asked_for);

}  // namespace active_matching_slam
