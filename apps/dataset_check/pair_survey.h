#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "frontend/matching/pair_matches.h"

namespace hybrid_slam {

// How far the rows of left and right agree, by matches of small features.
struct RowAgreement {
  int matches = 0;
  double error = 0;   // median of the absolute difference of the rows [px]
  double offset = 0;  // median of the difference, left less right [px]
};

// What the matches of many pairs say of the rig: by their looks alone, wherever they lie.
class PairSurvey {
 public:
  static constexpr int kGrid = 3;  // regions in both directions

  PairSurvey(int width, int height) : width_(width), height_(height) {}

  void add(const std::vector<PairMatch>& matches);

  std::size_t matches() const { return all_.size(); }
  RowAgreement rows() const;
  RowAgreement rows_in(int column, int row) const;  // of the grid, by the place in the left image

  // Share of the matches near the same row that would lie behind the cameras; as in PairCheck.
  double reversed() const;

  // Disparities of the matches whose rows agree with all the others' [px]: the value that `percent`
  // of them do not exceed; 0 of none.
  double disparity(double percent) const;

 private:
  int width_;
  int height_;
  std::vector<PairMatch> all_;
};

}  // namespace hybrid_slam
