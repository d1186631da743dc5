#include "frontend/matching/cuda/cuda_matcher.h"

#include "frontend/features/cuda/cuda_sift_engine.cuh"
#include "frontend/matching/cuda/matcher_engine.h"

namespace hybrid_slam {

struct CudaFeatures::Memory {
  cuda::OnDevice device;
  unsigned* words = nullptr;
  int capacity = 0;
  int count = 0;

  void reserve(int wanted) {
    if (wanted <= capacity) return;
    capacity = 0;  // and so it stays if there is too little memory
    device.release();
    const std::size_t bytes = static_cast<std::size_t>(wanted) * sift::kDescriptorSize;
    words = static_cast<unsigned*>(device.allocate(bytes));
    capacity = wanted;
  }
  cuda::DescriptorsView view() const { return {words, count}; }
};

CudaFeatures::CudaFeatures() : memory_(std::make_unique<Memory>()) {}
CudaFeatures::~CudaFeatures() = default;
CudaFeatures::CudaFeatures(CudaFeatures&&) noexcept = default;
CudaFeatures& CudaFeatures::operator=(CudaFeatures&&) noexcept = default;

void CudaFeatures::assign(const CudaSift& sift) {
  const cuda::FeaturesView from = sift.engine_->sift.features();
  memory_->reserve(from.capacity);
  memory_->count = sift.engine_->sift.finished_count();
  if (memory_->count == 0) return;
  memory_->device.copy(memory_->words, from.descriptors,
                       static_cast<std::size_t>(memory_->count) * sift::kDescriptorSize);
  memory_->device.wait();
}

void CudaFeatures::assign(const std::vector<Descriptor>& descriptors) {
  memory_->reserve(static_cast<int>(descriptors.size()));
  memory_->count = static_cast<int>(descriptors.size());
  if (memory_->count == 0) return;
  memory_->device.upload_now(memory_->words, descriptors.data(),
                             descriptors.size() * sizeof(Descriptor));
}

int CudaFeatures::size() const { return memory_->count; }

struct CudaMatcher::Engine {
  cuda::MatcherEngine<cuda::OnDevice> matcher;
};

CudaMatcher::CudaMatcher() : engine_(std::make_unique<Engine>()) {}
CudaMatcher::~CudaMatcher() = default;

std::vector<DescriptorMatch> CudaMatcher::match(const CudaFeatures& query,
                                                const CudaFeatures& train,
                                                const BruteForceOptions& options) {
  return engine_->matcher.match(query.memory_->view(), train.memory_->view(), options);
}

std::vector<CircularMatch> CudaMatcher::match_circular(const CudaStereoFeatures& previous,
                                                       const CudaStereoFeatures& current,
                                                       double max_descriptor_distance) {
  const auto view = [](const CudaStereoFeatures& stereo) {
    return cuda::StereoView{stereo.left.memory_->view(), stereo.right.memory_->view(),
                            &stereo.right_of_left};
  };
  return engine_->matcher.match_circular(view(previous), view(current), max_descriptor_distance);
}

void CudaMatcher::time(CudaTiming timing) { engine_->matcher.backend().time(timing); }

CudaStageTimes CudaMatcher::stage_times() const { return engine_->matcher.backend().stage_times(); }

}  // namespace hybrid_slam
