#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "backend/incremental/landmark_term.h"

namespace hybrid_slam {

class Front;

// Landmarks that no pose has seen for a while, as one term on the poses that saw them: the sum of
// their LandmarkTerms, each with its landmark eliminated. With the deltas d of its poses it is
// worth
//   squared_norm + 2 gradient^T (d - at) + (d - at)^T H (d - at).
// It takes the place of its landmarks' linearisations, in a small part of their memory and time. It
// is a cache: the observations are still there, and it is made anew from them where its poses have
// changed their shape, and taken apart where one of its landmarks changes.
struct CondensedTerm {
  struct Member {
    std::uint32_t landmark = 0;
    std::uint32_t first = 0;   // of its observations; the next member's first is behind the last
    std::uint32_t anchor = 0;  // a pose's variable that carries the point along
    Eigen::Vector3f in_anchor = Eigen::Vector3f::Zero();
  };

  // What a view says about its pose, in squares, summed up: by a turn [1/rad^2], by a way [1/m^2].
  struct Reach {
    double by_turn = 0;
    double by_way = 0;
    int views = 0;
  };

  std::vector<Member> members;  // ascending
  std::vector<std::uint32_t> observations;
  std::vector<std::uint32_t> poses;  // that vary
  bool is_held = false;              // by a view of a fixed pose
  // H: blocks (i, i), and between two poses, in what takes less memory: as they are, (i, j) with
  // j < i, row after row, or as they come from the landmarks, each of which leaves
  // -reduced_i reduced_j^T on two poses that see it (LandmarkTerm).
  std::vector<Matrix6d> own;
  std::vector<Eigen::Matrix<float, 6, 6>> shared;
  struct Reduced {
    std::uint32_t slot = 0;  // of its pose
    Eigen::Matrix<float, 6, 3> by_pose = Eigen::Matrix<float, 6, 3>::Zero();
  };
  std::vector<Reduced> reduced;
  std::vector<std::uint32_t> reduced_first;  // of each landmark's; behind the last one's at the end
  Eigen::VectorXd gradient;                  // at `at`
  Eigen::VectorXd at;                        // the poses' deltas when it was made
  double squared_norm = 0;                   // likewise: of the weighted residuals
  double loss_excess = 0;                    // what the losses make of that, beyond it
  int rows = 0;
  std::vector<Reach> reach;      // by pose
  Eigen::VectorXd placed;        // the poses' deltas when the members' points were minimised
  bool is_stale = false;         // its views have changed since, so that they are to be once more
  Eigen::VectorXf evaluated_at;  // the poses' deltas when it was evaluated last

  std::span<const std::uint32_t> observations_of(std::size_t member) const;
  // Members that were added come in among the others.
  void order_members();

  // What a term takes of memory that landmarks with so many views by these many poses share.
  static std::size_t bytes(std::size_t poses, std::size_t views);

  // Empties what sums up, for these poses with these deltas.
  void begin(std::vector<std::uint32_t> poses, Eigen::VectorXd deltas);

  // More poses, that nothing is said about so far. `all` has those that are there already, too;
  // ascending as these. The new ones come with deltas for `at` and for `placed`.
  void widen(std::vector<std::uint32_t> all, const Eigen::VectorXd& new_at,
             const Eigen::VectorXd& new_placed);

  // Adds landmarks' linearisations. `costs`: twice, with their losses, at the deltas `now`.
  // `places`: of the poses' tangents.
  void add(std::span<const LandmarkTerm* const> landmarks, std::span<const double> costs,
           std::span<const Eigen::Vector3d> places, const Eigen::VectorXd& now);

  // Of the weighted residuals, as far as second order tells.
  double squared_norm_at(const Eigen::VectorXd& deltas) const;

  // H v.
  Eigen::VectorXd times(const Eigen::VectorXd& v) const;

  void assemble(Front& front) const;

 private:
  // The blocks (i, j) with j < i while they are summed up.
  using Sums = std::vector<Matrix6d>;

  std::size_t slot(std::uint32_t pose) const;
  static std::size_t place_of(std::size_t i, std::size_t j) { return i * (i - 1) / 2 + j; }
  Matrix6d shared_block(std::size_t i, std::size_t j) const;
  std::span<const Reduced> reduced_of(std::size_t landmark) const;
  void add(const LandmarkTerm& landmark, Sums& sums);
  void add_known(Sums& sums) const;
  void add_reduced(const LandmarkTerm& landmark, Sums& sums);
  void keep(Sums& sums);
  void assemble_reduced(std::size_t landmark, Front& front) const;
  void make_up_for(const Sums& lost, std::span<const Eigen::Vector3d> places);
};

}  // namespace hybrid_slam
