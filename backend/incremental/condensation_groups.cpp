#include "backend/incremental/condensation_groups.h"

#include <algorithm>
#include <iterator>
#include <tuple>
#include <utility>

#include "backend/incremental/condensed_term.h"

namespace hybrid_slam {

namespace {

// Multiplications of a landmark that becomes a term of its own: a view's derivatives and what is
// left of them once the landmark is eliminated, and the blocks of 6 x 3 times 3 x 6 between poses.
double work_apart(std::size_t poses) {
  const auto n = static_cast<double>(poses);
  return 500 * n + 54 * n * (n + 1);
}

struct Group {
  CondensedGroup made;
  std::size_t views = 0;
  double work = 0;

  std::size_t bytes() const { return CondensedTerm::bytes(made.poses.size(), views); }
};

std::vector<std::uint32_t> united(const std::vector<std::uint32_t>& a,
                                  const std::vector<std::uint32_t>& b) {
  std::vector<std::uint32_t> both;
  std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return both;
}

void add(Group& group, const Group& more) {
  group.made.poses = united(group.made.poses, more.made.poses);
  group.made.points.insert(group.made.points.end(), more.made.points.begin(),
                           more.made.points.end());
  group.views += more.views;
  group.work += more.work;
}

Group group_of(const CondensableLandmark& landmark) {
  Group group;
  group.made.points = {landmark.point};
  group.made.poses = landmark.poses;
  group.views = landmark.poses.size();
  group.work = work_apart(landmark.poses.size());
  return group;
}

Group group_of(const KnownGroup& known) {
  Group group;
  group.made.term = known.term;
  group.made.poses = known.poses;
  for (const std::size_t views : known.views) {
    group.views += views;
    group.work += work_apart(views);
  }
  return group;
}

// Whether a group may take a batch in: where its memory per view falls by it, or the batch takes
// less than half of what it would take alone. (To take less than alone is not enough: the next ones
// would find a group that is too large where they could begin a better one.)
bool pays(const Group& group, const Group& batch, std::size_t growth) {
  const double with = static_cast<double>(group.bytes() + growth);
  const bool falls =
      with * static_cast<double>(group.views) <
      static_cast<double>(group.bytes()) * static_cast<double>(group.views + batch.views);
  return growth < batch.bytes() && (falls || 2 * growth < batch.bytes());
}

// Adds it to the group that grows the least by it, or as one of its own.
void take_in(Group batch, double most_work, std::vector<Group>& groups) {
  std::size_t least = 0;
  Group* best = nullptr;
  for (Group& group : groups) {
    if (group.work + batch.work > most_work) continue;
    const std::size_t poses = united(group.made.poses, batch.made.poses).size();
    const std::size_t with = CondensedTerm::bytes(poses, group.views + batch.views);
    const std::size_t growth = with - group.bytes();
    if (!pays(group, batch, growth) || (best != nullptr && growth >= least)) continue;
    least = growth;
    best = &group;
  }
  if (best == nullptr) {
    groups.push_back(std::move(batch));
  } else {
    add(*best, batch);
  }
}

}  // namespace

std::vector<CondensedGroup> condensed_groups(std::vector<CondensableLandmark> landmarks,
                                             const std::vector<KnownGroup>& known,
                                             double most_work) {
  std::sort(landmarks.begin(), landmarks.end(),
            [](const CondensableLandmark& a, const CondensableLandmark& b) {
              return std::tie(a.clique, a.poses, a.point) < std::tie(b.clique, b.poses, b.point);
            });
  std::vector<CondensedGroup> all;
  for (std::size_t next = 0; next < landmarks.size();) {
    const std::int32_t clique = landmarks[next].clique;
    std::vector<Group> groups;
    for (const KnownGroup& one : known) {
      if (one.clique == clique) groups.push_back(group_of(one));
    }
    while (next < landmarks.size() && landmarks[next].clique == clique) {
      Group batch = group_of(landmarks[next]);
      const std::uint32_t first = batch.made.poses.front();
      for (++next; next < landmarks.size() && landmarks[next].clique == clique &&
                   landmarks[next].poses.front() == first;
           ++next) {
        const Group one = group_of(landmarks[next]);
        if (batch.work + one.work > most_work) break;
        add(batch, one);
      }
      take_in(std::move(batch), most_work, groups);
    }
    for (Group& group : groups) {
      if (!group.made.points.empty()) all.push_back(std::move(group.made));
    }
  }
  return all;
}

}  // namespace hybrid_slam
