#pragma once

#include "active_matching_slam/matching/matcher.h"

namespace active_matching_slam {

/// Plain MonoSLAM: in each 3-sigma ellipse the match of the highest score.
class ActiveSearchMatcher : public Matcher {
 public:
  std::string name() const override { return "active_search"; }
  MatchResult match(const MeasurementPrior& prior, FeatureSearch& search,
                    const MatchOptions& options) override;
};

/// Joint Compatibility Branch and Bound (Neira & Tardos 2001): all matches in all 3-sigma ellipses,
/// then the largest set of pairings of which every prefix, in feature order, is jointly compatible;
/// of equal sets the one of least Mahalanobis distance.
class JcbbMatcher : public Matcher {
 public:
  std::string name() const override { return "jcbb"; }
  MatchResult match(const MeasurementPrior& prior, FeatureSearch& search,
                    const MatchOptions& options) override;
};

/// 1-point RANSAC for EKF filtering (Civera et al. 2010): the best match of each feature,
/// hypotheses from one match each, then a rescue of high-innovation inliers.
class OnePointRansacMatcher : public Matcher {
 public:
  std::string name() const override { return "one_point_ransac"; }
  MatchResult match(const MeasurementPrior& prior, FeatureSearch& search,
                    const MatchOptions& options) override;
};

}  // namespace active_matching_slam
