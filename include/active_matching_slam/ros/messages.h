#pragma once

#include <geometry_msgs/Point.h>
#include <geometry_msgs/Vector3.h>
#include <ros/ros.h>
#include <std_msgs/Header.h>

// The message generator puts a package's messages into the namespace of the package, where several
// names (TrackingState, SubmapHierarchy, ...) belong to the core library. Here, and for this
// package's own sources only, they live in `ams_msgs`; names on the wire and checksums are
// untouched. (gencpp has no option for the namespace: without the macro it takes a package for the
// messages alone, which users expect in msg/ and srv/ of this one.)
#define active_matching_slam ams_msgs
#include <active_matching_slam/FeatureArray.h>
#include <active_matching_slam/LoadMap.h>
#include <active_matching_slam/MatchHypotheses.h>
#include <active_matching_slam/MatchingStatistics.h>
#include <active_matching_slam/MutualInformationGraph.h>
#include <active_matching_slam/SaveMap.h>
#include <active_matching_slam/SaveTrajectory.h>
#include <active_matching_slam/SetMatcher.h>
#include <active_matching_slam/SetScale.h>
#include <active_matching_slam/SubmapHierarchy.h>
#include <active_matching_slam/TrackingState.h>
#undef active_matching_slam
