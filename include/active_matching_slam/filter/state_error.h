#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "active_matching_slam/filter/camera_state.h"
#include "active_matching_slam/filter/covariance_matrix.h"
#include "active_matching_slam/filter/feature_state.h"

namespace active_matching_slam {

/// Adds the error state `delta` to the mean. With theta its rotation part and J the left Jacobian
/// of SO(3): R <- exp(theta) R; positions and velocities p <- p + J d, the exponential of SE_k(3)
/// (Barrau & Bonnabel 2015), so that a common motion of camera and map is followed exactly; a
/// bearing turns by exp(m x B d + m (m . theta)), for the same reason; angular velocity, inverse
/// depth, readout, lens and a gyroscope's bias add.
void applyError(const Eigen::Ref<const Eigen::VectorXd>& delta, CameraState& camera,
                std::vector<FeatureState>& features);

/// The error state that moves the camera, its velocity and the `carried` features (ascending ids)
/// by `T_new_old`, a motion of the world, however large, and leaves the other features where they
/// are.
Eigen::VectorXd errorOfMotion(const Eigen::Isometry3d& T_new_old, const CameraState& camera,
                              const std::vector<FeatureState>& features,
                              const std::vector<FeatureId>& carried, int state_size);

/// Gauge freedoms that a correction must leave as they were: rotation of the world (3) and scale
/// (1). Derivation: of the seven of a similarity, translation needs no care: its generator is the
/// same everywhere.
constexpr int kGaugeFreedoms = 4;

/// How every error answers to a small rotation of the world about its origin (columns 0 to 2) and
/// to a small growth of all lengths (column 3); state size x 4. A position p gives -[p]x and p, the
/// camera's rotation I and 0, a bearing -B^T [m]x and 0, an inverse depth 0 and -rho.
Eigen::MatrixXd gaugeGenerators(const CameraState& camera,
                                const std::vector<FeatureState>& features, int state_size);

/// L, state size x 4, with L^T gaugeGenerators() = I: reads rotation and relative scale off an
/// error. Rotation is the camera's; scale the mean of what the features say, by the inverse
/// variance of each: -d rho / rho, and for a point the change of its distance from the camera. No
/// translation or rotation of the world changes that.
Eigen::MatrixXd gaugeFunctionals(const CameraState& camera,
                                 const std::vector<FeatureState>& features,
                                 const CovarianceMatrix& covariance);

/// Row of a bearing in the generators of rotation, 2 x 3.
Eigen::Matrix<double, 2, 3> bearingGauge(const FeatureState& feature);

}  // namespace active_matching_slam
