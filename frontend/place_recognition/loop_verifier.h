#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "backend/map/loop_measurement.h"
#include "backend/map/map_snapshot.h"
#include "frontend/place_recognition/keyframe_database.h"
#include "frontend/pose/relative_pose.h"

namespace hybrid_slam {

// Why a proposed loop is none.
enum class LoopRejection {
  kNone,            // it is one
  kFewMatches,      // descriptors
  kNoGeometry,      // no motion between the two explains enough matches
  kFewAfterSearch,  // the motion does not hold where the places overlap
  kUnlike,          // of what should be in view too little is found
  kUnconfirmed,     // no neighbour of the keyframe sees the place
};

const char* to_string(LoopRejection reason);

struct LoopVerifierOptions {
  double ratio = 0.8;                    // best against second best descriptor below a node
  double max_descriptor_distance = 0.7;  // L2 between unit descriptors
  int min_matches = 20;                  // ORB-SLAM2's, as are the radius and the counts below
  double search_radius = 7.5;            // [px] around projections; grows with the scale
  double max_scale_ratio = 1.7;          // between predicted and observed scale
  int min_final_matches = 40;            // landmarks of the older side that the keyframe shows
  // The two sides were estimated apart from each other and differ where either is bent [px].
  double surroundings_sigma = 1;
  int neighbours = 10;            // covisible keyframes, of each end
  int min_shared_landmarks = 15;  // that make two keyframes neighbours
  // Found among the older side's landmarks that should be in view. A place seen again shows a third
  // and more of them, repeated texture agrees in a patch only.
  double min_found_share = 0.2;
  int min_confirmations = 15;  // landmarks of the older side, in one neighbour of the keyframe
  RelativePoseOptions pose;

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

struct LoopVerification {
  std::optional<LoopMeasurement> loop;
  LoopRejection reason = LoopRejection::kFewMatches;
  int matches = 0;         // of descriptors, between landmarks
  int inliers = 0;         // of these, that agree with the motion
  int final_matches = 0;   // landmarks of the older side found in the keyframe
  double found_share = 0;  // of those that should be in view
  int confirmations = 0;   // found in a neighbour of the keyframe
};

// Whether two keyframes show one place, by geometry alone: where the map has put the two plays no
// part. The motion between them is that which takes the landmarks of one side to where the other
// side's camera sees them, both ways (SE3 where both sides hold a stereo pair and so know their
// scale, else Sim3), found in RANSAC from descriptor matches; then the landmarks around each end
// are looked for in the other. Const and without state: any thread.
class LoopVerifier {
 public:
  // Throws std::invalid_argument if the options are not valid.
  explicit LoopVerifier(const LoopVerifierOptions& options);

  // `keyframe` is the newer one. Both are in `places`, else nothing matches.
  LoopVerification verify(const MapSnapshot& map, KeyframeId keyframe, KeyframeId match,
                          const KeyframeDatabase& places) const;

 private:
  LoopVerifierOptions options_;
};

}  // namespace hybrid_slam
