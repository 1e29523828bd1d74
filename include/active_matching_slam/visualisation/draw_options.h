#pragma once

#include "active_matching_slam/math/option_field.h"

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

  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void DrawOptions::visitFields(Self& o, Visitor&& visit) {
  visit(basicOption("draw/predictions", "", "predicted 3-sigma ellipses in ~debug_image"),
        o.predictions);
  visit(
      basicOption("draw/searches", "", "searched ellipses in ~debug_image, coloured first to last"),
      o.searches);
  visit(
      basicOption("draw/matches", "", "matches, accepted and not, and searches that found nothing"),
      o.matches);
  visit(basicOption("draw/templates", "", "the features' patches at the lower border"),
        o.templates);
  visit(basicOption("draw/information", "", "mutual information beside each candidate, in bits"),
        o.information);
  visit(basicOption("draw/tree", "", "links of the Chow-Liu tree in ~debug_image"), o.tree);
  visit(basicOption("draw/links", "",
                    "links of mutual information between visible features in ~debug_image"),
        o.links);
  visit(basicOption("draw/submaps", "",
                    "features and tree in the colours of their submaps in ~debug_image"),
        o.submaps);
  visit(basicOption("draw/status", "", "a line of text below ~debug_image"), o.status);
  visit(basicOption("draw/legend", "", "what the marks mean, below ~debug_image"), o.legend);
  visit(basicOption("draw/frustum_m", "m", "length of the camera's frustum in ~markers/camera"),
        o.frustum_m, 1e-3, 1e3);
  visit(basicOption("draw/minimum_link_bits", "bit",
                    "weaker links are left out of ~markers/mutual_information and ~debug_image"),
        o.minimum_link_bits, 0.0, 100.0);
  visit(basicOption("draw/links_per_feature", "",
                    "largest number of links shown of each feature, the strongest; the tree's "
                    "besides"),
        o.links_per_feature, 0, 10000);
}

}  // namespace active_matching_slam
