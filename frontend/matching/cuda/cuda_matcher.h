#pragma once

#include <memory>
#include <vector>

#include "backend/map/features.h"
#include "frontend/features/cuda/cuda_sift.h"
#include "frontend/matching/brute_force.h"
#include "frontend/matching/circular_match.h"

namespace hybrid_slam {

// Descriptors that stay on the device.
class CudaFeatures {
 public:
  CudaFeatures();
  ~CudaFeatures();
  CudaFeatures(CudaFeatures&&) noexcept;
  CudaFeatures& operator=(CudaFeatures&&) noexcept;

  // Those that `sift` finished last, without a way over the host; it must have started no other.
  void assign(const CudaSift& sift);
  void assign(const std::vector<Descriptor>& descriptors);
  int size() const;

 private:
  friend class CudaMatcher;
  struct Memory;
  std::unique_ptr<Memory> memory_;
};

// The two sides of a stereo frame and which right feature belongs to each left one, or -1.
struct CudaStereoFeatures {
  CudaFeatures left;
  CudaFeatures right;
  std::vector<int> right_of_left;
};

// match_brute_force() and match_circular() of frontend/matching on a CUDA device: the same answers.
// That the kinds of descriptors agree is the caller's business. Errors of CUDA are
// std::runtime_error.
class CudaMatcher {
 public:
  CudaMatcher();
  ~CudaMatcher();

  std::vector<DescriptorMatch> match(const CudaFeatures& query, const CudaFeatures& train,
                                     const BruteForceOptions& options);
  // `max_descriptor_distance` between unit descriptors.
  std::vector<CircularMatch> match_circular(const CudaStereoFeatures& previous,
                                            const CudaStereoFeatures& current,
                                            double max_descriptor_distance);

  // Times of the last call are there if timing was on.
  void time(CudaTiming timing);
  CudaStageTimes stage_times() const;

 private:
  struct Engine;
  std::unique_ptr<Engine> engine_;
};

}  // namespace hybrid_slam
