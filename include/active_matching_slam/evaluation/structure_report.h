#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "active_matching_slam/information/mutual_information_graph.h"
#include "active_matching_slam/information/submap_hierarchy.h"

namespace active_matching_slam {

/// What a run found out about the structure of its map, as tables and pictures.

/// One row a link: first, second, information_bits, frames, in_tree (0 or 1).
std::string mutualInformationCsv(const MutualInformationGraph& graph);

/// One row a level and feature: level, feature (id), submap (label).
std::string submapsCsv(const SubmapHierarchy& hierarchy);

/// One row a level: level, submaps, preserved_chow_liu, preserved_naive (fractions, 0 to 1).
std::string submapQualityCsv(const SubmapHierarchy& hierarchy);

/// The matrices of pairwise information at one level, ordered by cluster (Chli 2009, Fig. 6.13),
/// 8-bit BGR. Upper row: features ordered by submap, all links and beside them the links that the
/// submaps preserve. Lower row: features in order of initialisation, all links and those that the
/// naive partition into as many parts of equal size preserves. Bright is much information; clusters
/// are framed. Throws std::invalid_argument when the level does not exist or the hierarchy is of
/// another graph.
cv::Mat informationMatrixPicture(const MutualInformationGraph& graph,
                                 const SubmapHierarchy& hierarchy, int level);

/// Writes mutual_information.csv, submaps.csv, submap_quality.csv and, for every level that groups
/// features without joining all, mutual_information_level_<level>.png into an existing directory,
/// in place of any that are there. Throws std::runtime_error naming the file.
void writeStructureReport(const std::string& directory, const MutualInformationGraph& graph,
                          const SubmapHierarchy& hierarchy);

}  // namespace active_matching_slam
