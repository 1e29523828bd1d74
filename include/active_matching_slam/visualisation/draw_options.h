#pragma once

namespace active_matching_slam {

/// What is drawn into the debug image and sent as markers.
struct DrawOptions {
  bool predictions = true;  ///< 3-sigma ellipses of the prior
  bool searches = true;     ///< ellipses that were searched, first to last
  bool matches = true;
  bool templates = false;    ///< the patches, at the lower border
  bool information = false;  ///< bits beside each candidate
  bool tree = false;         ///< links of the Chow-Liu tree
  bool links = false;        ///< links of mutual information
  bool submaps = false;      ///< features and tree in the colours of their submaps
  bool status = true;        ///< one line of text
  bool legend = true;        ///< what the marks mean
  double frustum_m = 0.15;
  double minimum_link_bits = 0.5;
  int links_per_feature = 3;  ///< see linksToShow()
};

}  // namespace active_matching_slam
