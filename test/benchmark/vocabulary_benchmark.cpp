// The vocabulary: words of descriptors, loading, querying the inverted index, candidates for loops,
// guided matching.
// Trees are complete, of 10 branches, their descriptors random around their parents'.
#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include <benchmark/benchmark.h>

#include "backend/map/map.h"
#include "frontend/place_recognition/guided_matching.h"
#include "frontend/place_recognition/inverted_index.h"
#include "frontend/place_recognition/loop_detector.h"
#include "frontend/place_recognition/vocabulary_file.h"
#include "test/support/random.h"
#include "test/support/synthetic_scene.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

constexpr NodeId kBranching = 10;

Descriptor near(const Descriptor& descriptor, int spread, Random& random) {
  Descriptor result;
  const std::uint64_t range = 2 * static_cast<std::uint64_t>(spread) + 1;
  std::uint64_t bits = 0;
  for (std::size_t k = 0; k < result.size(); ++k) {
    if (k % 8 == 0) bits = random.bits();
    const int change = static_cast<int>((bits & 0xff) % range) - spread;
    bits >>= 8;
    result[k] = static_cast<std::uint8_t>(std::clamp(descriptor[k] + change, 0, 255));
  }
  return result;
}

struct Tree {
  std::vector<NodeId> first_child;
  std::vector<float> weights;
  std::vector<Descriptor> bytes;
};

Vocabulary make_vocabulary(int levels) {
  Random random(1);
  auto tree = std::make_shared<Tree>();
  tree->bytes.emplace_back();
  tree->bytes[0].fill(40);
  std::size_t inner = 1;
  for (int level = 1; level < levels; ++level) inner = inner * kBranching + 1;
  for (std::size_t node = 0; node < inner; ++node) {
    tree->first_child.push_back(static_cast<NodeId>(tree->bytes.size()));
    const Descriptor parent = tree->bytes[node];
    const int spread = node == 0 ? 30 : 15;
    for (NodeId i = 0; i < kBranching; ++i) tree->bytes.push_back(near(parent, spread, random));
  }
  const std::size_t nodes = tree->bytes.size();
  tree->first_child.resize(nodes + 1, static_cast<NodeId>(nodes));
  for (std::size_t i = 0; i < nodes; ++i) {
    tree->weights.push_back(static_cast<float>(random.uniform(1, 9)));
  }
  return Vocabulary({DescriptorKind::kRootSift,
                     static_cast<int>(kBranching),
                     levels,
                     tree->first_child,
                     tree->weights,
                     tree->bytes,
                     {}},
                    tree);
}

// Four levels: 10,000 words; six: a million.
const Vocabulary& vocabulary_of(std::int64_t levels) {
  static const Vocabulary kFour = make_vocabulary(4);
  if (levels == 4) return kFour;
  static const Vocabulary kSix = make_vocabulary(6);
  return kSix;
}

// About words of the tree.
FeatureSet random_features(const Vocabulary& vocabulary, int count, Random& random) {
  FeatureSet features;
  features.kind = vocabulary.kind();
  const auto& bytes = vocabulary.tables().bytes;
  for (int i = 0; i < count; ++i) {
    const std::size_t word = bytes.size() - 1 - random.below(vocabulary.words());
    features.descriptors.push_back(near(bytes[word], 10, random));
  }
  features.keypoints.resize(features.descriptors.size());
  return features;
}

void find(benchmark::State& state) {
  const Vocabulary& vocabulary = vocabulary_of(state.range(0));
  Random random(2);
  const FeatureSet features = random_features(vocabulary, 20000, random);
  for (auto _ : state) {
    benchmark::DoNotOptimize(vocabulary.find(features.kind, features.descriptors));
  }
  state.counters["per_descriptor"] = benchmark::Counter(
      static_cast<double>(features.size()),
      benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void words_of_image(benchmark::State& state) {
  const Vocabulary& vocabulary = vocabulary_of(state.range(0));
  Random random(2);
  const FeatureSet features = random_features(vocabulary, 2000, random);
  for (auto _ : state) benchmark::DoNotOptimize(find_words(vocabulary, features));
}

void load(benchmark::State& state, VocabularyFormat format) {
  const TempFolder folder;
  const auto path = folder.path() / "voc";
  save_vocabulary(path, vocabulary_of(state.range(0)), format);
  for (auto _ : state) benchmark::DoNotOptimize(load_vocabulary(path));
  state.counters["MB"] = static_cast<double>(std::filesystem::file_size(path)) * 1e-6;
}

void load_mapped(benchmark::State& state) { load(state, VocabularyFormat::kMapped); }
void load_compressed(benchmark::State& state) { load(state, VocabularyFormat::kCompressed); }
void load_text(benchmark::State& state) { load(state, VocabularyFormat::kText); }

// Keyframes of 2000 features. An image shares an eighth of them with each of its neighbours.
struct Keyframes {
  Keyframes(const Vocabulary& vocabulary, std::int64_t count) {
    Random random(3);
    FeatureSet last = random_features(vocabulary, 2000, random);
    for (std::uint32_t i = 0; i < count; ++i) {
      FeatureSet features = random_features(vocabulary, 2000, random);
      std::copy_n(last.descriptors.end() - 250, 250, features.descriptors.begin());
      newest = find_words(vocabulary, features).bow;
      index.add(KeyframeId(i), newest);
      last = features;
    }
  }
  InvertedIndex index;
  BowVector newest;
};

void query(benchmark::State& state) {
  static std::map<std::pair<std::int64_t, std::int64_t>, Keyframes> made;
  const std::pair key(state.range(0), state.range(1));
  const auto& keyframes = made.try_emplace(key, vocabulary_of(key.first), key.second).first->second;
  std::size_t hits = 0;
  for (auto _ : state) hits = keyframes.index.query(keyframes.newest, {}).size();
  state.counters["hits"] = static_cast<double>(hits);
}

// A map of keyframes of 2000 features that pass each of 500 places again and again, and a database
// that follows it. An image shares an eighth of its features with each of its neighbours, and four
// fifths of its landmarks.
struct Survey {
  Survey(const Vocabulary& vocabulary, std::int64_t count) : places(vocabulary) {
    Random random(5);
    std::vector<std::shared_ptr<const FrameObservations>> images;
    for (std::size_t i = 0; i < 500; ++i) {
      auto image = std::make_shared<FrameObservations>();
      image->camera = CameraId(0);
      image->features = random_features(vocabulary, 2000, random);
      image->u_right.assign(2000, 0);
      if (i > 0) {
        const auto& last = images.back()->features.descriptors;
        std::copy_n(last.end() - 250, 250, image->features.descriptors.begin());
      }
      images.push_back(std::move(image));
    }
    map.add_camera(synthetic_stereo_camera(0.1));
    for (std::int64_t i = 0; i < count; ++i) {
      NewKeyframe made;
      made.observations = images[static_cast<std::size_t>(i) % images.size()];
      made.landmarks.resize(2000);
      made.reference = newest;
      if (i % 500 != 0) {  // a lap shares no landmarks with the one before
        const auto& last = map.view().at(newest).landmarks;
        std::copy_n(last.begin(), 160, made.landmarks.begin() + 40);
      }
      for (std::uint32_t k = 0; k < (i % 500 == 0 ? 200 : 40); ++k) {
        made.new_points.push_back({k, Eigen::Vector3d(random.gaussian3(1).x(), 0, 3)});
      }
      newest = map.add_keyframe(made);
    }
    places.follow(map.view());
  }

  Map map;
  KeyframeDatabase places;
  KeyframeId newest;
};

Survey& survey_of(std::int64_t count) {
  static std::map<std::int64_t, Survey> made;
  return made.try_emplace(count, vocabulary_of(4), count).first->second;
}

void detect_loop(benchmark::State& state) {
  const Survey& survey = survey_of(state.range(0));
  LoopDetector detector({});
  std::size_t candidates = 0;
  for (auto _ : state) {
    candidates = detector.detect(survey.map.view(), survey.places, survey.newest).size();
  }
  state.counters["candidates"] = static_cast<double>(candidates);
}

void follow_unchanged(benchmark::State& state) {
  Survey& survey = survey_of(state.range(0));
  for (auto _ : state) survey.places.follow(survey.map.view());
}

struct Pair {
  explicit Pair(const Vocabulary& vocabulary) {
    Random random(4);
    query = random_features(vocabulary, 2000, random);
    train = random_features(vocabulary, 2000, random);
    for (std::size_t i = 0; i < 1000; ++i) {
      train.descriptors[i] = near(query.descriptors[i], 6, random);
    }
  }
  FeatureSet query, train;
};

void match_by_nodes(benchmark::State& state) {
  const Vocabulary& vocabulary = vocabulary_of(4);
  const Pair pair(vocabulary);
  const DirectIndex query_index = find_words(vocabulary, pair.query).index;
  const DirectIndex train_index = find_words(vocabulary, pair.train).index;
  const BruteForceOptions options{.ratio = 0.8};
  std::size_t matches = 0;
  for (auto _ : state) {
    matches = match_guided(pair.query, query_index, pair.train, train_index, options).size();
  }
  state.counters["matches"] = static_cast<double>(matches);
}

void match_all(benchmark::State& state) {
  const Pair pair(vocabulary_of(4));
  const BruteForceOptions options{.ratio = 0.8};
  std::size_t matches = 0;
  for (auto _ : state) matches = match_brute_force(pair.query, pair.train, options).size();
  state.counters["matches"] = static_cast<double>(matches);
}

BENCHMARK(find)->Arg(4)->Arg(6)->Unit(benchmark::kMillisecond);
BENCHMARK(words_of_image)->Arg(4)->Arg(6)->Unit(benchmark::kMillisecond);
BENCHMARK(load_mapped)->Arg(4)->Arg(6)->Unit(benchmark::kMillisecond);
BENCHMARK(load_compressed)->Arg(4)->Unit(benchmark::kMillisecond);
BENCHMARK(load_text)->Arg(4)->Unit(benchmark::kMillisecond);
BENCHMARK(query)
    ->ArgsProduct({{4, 6}, {1000, 2000}})
    ->ArgNames({"levels", "keyframes"})
    ->Unit(benchmark::kMillisecond);
BENCHMARK(detect_loop)->Arg(200)->Arg(2000)->Unit(benchmark::kMillisecond);
BENCHMARK(follow_unchanged)->Arg(200)->Arg(2000)->Unit(benchmark::kNanosecond);
BENCHMARK(match_by_nodes)->Unit(benchmark::kMillisecond);
BENCHMARK(match_all)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace hybrid_slam
