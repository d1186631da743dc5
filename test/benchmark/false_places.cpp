// Do two maps of unlike ground look like one place anywhere? Every keyframe of the one against
// every keyframe of the other, without the vocabulary's choice before it: geometry alone has to say
// no.
//   false_places A.map B.map
// Prints how many pairs were refused and why, and those that were taken for one place.
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "backend/map/map_assembly.h"
#include "backend/map/map_file.h"
#include "frontend/place_recognition/default_vocabulary.h"
#include "frontend/place_recognition/loop_verifier.h"

namespace hybrid_slam {
namespace {

int run(const char* first, const char* second) {
  const Map a = load_map(first).map;
  const Map b = load_map(second).map;
  const std::vector<MapPart> parts{{&a.view(), a.view().keyframe_ids(), {}},
                                   {&b.view(), b.view().keyframe_ids(), {}}};
  const Map map = assemble_map(parts);
  KeyframeDatabase places(default_vocabulary());
  places.follow(map.view());
  const LoopVerifier verifier{LoopVerifierOptions()};
  const std::vector<KeyframeId> ids = map.view().keyframe_ids();
  const std::size_t of_a = parts[0].keyframes.size();
  std::map<std::string, int> reasons;
  int taken = 0;
  for (std::size_t i = of_a; i < ids.size(); ++i) {
    for (std::size_t j = 0; j < of_a; ++j) {
      const LoopVerification found = verifier.verify(map.view(), ids[i], ids[j], places);
      if (!found.loop) {
        ++reasons[to_string(found.reason)];
        continue;
      }
      ++taken;
      std::printf("taken for one place: keyframe %zu of %s and %zu of %s, %d landmarks\n", j, first,
                  i - of_a, second, found.final_matches);
    }
  }
  std::printf("%zu pairs, %d taken for one place\n", of_a * (ids.size() - of_a), taken);
  for (const auto& [reason, count] : reasons) std::printf("  %-20s %d\n", reason.c_str(), count);
  return 0;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: false_places A.map B.map\n", stderr);
    return 2;
  }
  return hybrid_slam::run(argv[1], argv[2]);
}
