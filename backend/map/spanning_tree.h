#pragma once

#include "backend/map/map_tables.h"

namespace hybrid_slam {

// The spanning tree carries corrections to keyframes that an optimisation did not know. The origin
// is its root; every other keyframe hangs from the one with which it shares most landmarks.

// Hangs a new keyframe (not the origin), without children, below its parent: the keyframe with most
// landmarks in common, or `reference` (or what is left of its branch) while nothing is shared.
void attach_to_tree(MapTables& tables, KeyframeId id, KeyframeId reference);

// Takes a keyframe (not the origin) out of the tree, leaving a tombstone in tables.erased. Its
// children go, strongest edge first, to its parent or to one another; a cycle cannot arise because
// each goes to a keyframe that already hangs from that parent.
void detach_from_tree(MapTables& tables, KeyframeId id);

}  // namespace hybrid_slam
