#include "frontend/place_recognition/vocabulary_file.h"

#include <fstream>
#include <functional>

#include <xxhash.h>

#include <catch2/catch.hpp>

#include "cameras/files/input_error.h"
#include "cameras/files/output_file.h"
#include "test/frontend/place_recognition/sample_vocabulary.h"
#include "test/support/allocation_watch.h"
#include "test/support/shared_cases.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

std::string content_of_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// What loading such a file complains about; empty if it does not.
std::string complaint(const std::string& content) {
  const TempFolder folder;
  const auto path = folder.path() / "voc";
  std::ofstream(path, std::ios::binary) << content;
  try {
    load_vocabulary(path);
  } catch (const InputError& error) {
    const std::string what = error.what();
    CHECK(what.starts_with(path.string() + ":"));
    CHECK(what.find('\n') == what.npos);
    return what.substr(path.string().size() + 1);
  }
  return {};
}

std::string saved(const Vocabulary& vocabulary, VocabularyFormat format) {
  const TempFolder folder;
  save_vocabulary(folder.path() / "voc", vocabulary, format);
  return content_of_file(folder.path() / "voc");
}

TEST_CASE("Vocabularies come back from files as they were") {
  const TempFolder folder;
  const auto path = folder.path() / "voc";
  for (const Vocabulary& vocabulary : {small_vocabulary(), in_floats(small_vocabulary(3, 4))}) {
    for (const auto format :
         {VocabularyFormat::kMapped, VocabularyFormat::kCompressed, VocabularyFormat::kText}) {
      save_vocabulary(path, vocabulary, format);
      const Vocabulary loaded = load_vocabulary(path);
      CHECK(same_tables(loaded, vocabulary));
      CHECK(loaded.words() == vocabulary.words());
      CHECK(saved(loaded, format) == content_of_file(path));
    }
  }
}

TEST_CASE("A loaded vocabulary outlives its file and the object it was loaded as") {
  const Vocabulary original = small_vocabulary();
  const auto descriptors = random_descriptors(200, 50, 3);
  std::optional<Vocabulary> copy;
  {
    const TempFolder folder;
    save_vocabulary(folder.path() / "voc", original, VocabularyFormat::kMapped);
    const Vocabulary loaded = load_vocabulary(folder.path() / "voc");
    copy = loaded;
  }
  CHECK(copy->find(DescriptorKind::kRootSift, descriptors) ==
        original.find(DescriptorKind::kRootSift, descriptors));
}

TEST_CASE("A vocabulary of another kind than expected is refused") {
  const TempFolder folder;
  const auto path = folder.path() / "voc";
  save_vocabulary(path, in_floats(small_vocabulary()), VocabularyFormat::kText);
  CHECK_NOTHROW(load_vocabulary(path, DescriptorKind::kPlainSift));
  CHECK_THROWS_WITH(load_vocabulary(path, DescriptorKind::kRootSift),
                    path.string() +
                        ": a vocabulary of plain SIFT descriptors is of no use to RootSIFT "
                        "descriptors");
}

TEST_CASE("What is no vocabulary is told so") {
  CHECK(complaint("") == " the file is empty");
  const TempFolder folder;
  CHECK_THROWS_AS(load_vocabulary(folder.path() / "none"), InputError);
  CHECK_THROWS_AS(load_vocabulary(folder.path()), InputError);
  CHECK_THROWS_AS(read_vocabulary("", "nothing"), InputError);
  CHECK_THROWS_AS(read_vocabulary("10 6 0 0\n", "text"), InputError);
}

TEST_CASE("Vocabularies of other programs are named for what they are") {
  using namespace std::string_literals;
  const auto named = [](const std::string& content, const std::string& as) {
    const std::string reason = complaint(content);
    INFO(reason);
    CHECK(reason.find(as) != std::string::npos);
  };
  named("\x1f\x8b\x08\0\0\0\0\0"s + "whatever", "gzip");
  named("BZh91AY&SY", "bzip2");
  named("PK\x03\x04"s + std::string(40, 'x'), "zip archive");
  named("ORBvoc.txt" + std::string(247, '\0') + "ustar" + std::string(250, '\0'), "tar archive");
  named("%YAML:1.0\nvocabulary:\n   k: 9\n", "YAML");
  named("\x0a\0\0\0\x06\0\0\0"s + std::string(100, '\7'), "binary file");  // ORBvoc.bin
}

TEST_CASE("ORB-SLAM's vocabulary is named for what it is") {
  const auto cases = shared_cases("vocabulary");
  if (!cases) return;
  CHECK_THROWS_WITH(load_vocabulary(*cases / "ORBvoc_like.txt"),
                    Catch::Contains("a vocabulary of ORB's descriptors"));
}

TEST_CASE("A binary vocabulary that is cut off or longer is refused") {
  for (const auto format : {VocabularyFormat::kMapped, VocabularyFormat::kCompressed}) {
    const std::string good = saved(small_vocabulary(), format);
    for (std::size_t size = 9; size < good.size(); size += 1 + size / 3) {
      INFO(size << " of " << good.size() << " bytes");
      CHECK(complaint(good.substr(0, size)) == " the file is cut off");
    }
    CHECK(complaint(good + "x") == " more follows the vocabulary");
  }
}

TEST_CASE("No byte of a binary vocabulary changes unnoticed") {
  for (const auto format : {VocabularyFormat::kMapped, VocabularyFormat::kCompressed}) {
    const std::string good = saved(small_vocabulary(2, 2), format);
    for (std::size_t i = 0; i < good.size(); i += i < 70 ? 1 : 13) {
      std::string damaged = good;
      damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
      INFO("byte " << i);
      CHECK_FALSE(complaint(damaged).empty());
    }
  }
}

void put_number(std::string& file, std::size_t at, std::uint64_t value, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) file[at + i] = static_cast<char>(value >> (8 * i));
}

// With the checksums that such a file would have.
std::string forged(std::string file, const std::function<void(std::string&)>& change) {
  change(file);
  put_number(file, 48, XXH3_64bits(file.data() + 64, file.size() - 64), 8);
  put_number(file, 56, XXH3_64bits(file.data(), 56), 8);
  return file;
}

TEST_CASE("A binary vocabulary that lies under right checksums is refused") {
  constexpr std::size_t kVersion = 8, kKind = 12, kElement = 16, kBranching = 20, kNodes = 28,
                        kCodec = 32, kTables = 64;
  for (const auto format : {VocabularyFormat::kMapped, VocabularyFormat::kCompressed}) {
    const std::string good = saved(small_vocabulary(), format);
    CHECK(complaint(forged(good, [](std::string&) {})).empty());
    const auto with = [&](std::size_t at, std::uint64_t value) {
      const AllocationWatch watch;
      const std::string reason =
          complaint(forged(good, [&](std::string& f) { put_number(f, at, value, 4); }));
      CHECK(watch.largest() < 1000000);
      return reason;
    };
    CHECK(with(kVersion, 2) == " version 2 of the format, not 1");
    CHECK(with(kKind, 77) == " unknown kind of descriptor");
    CHECK(with(kElement, 3) == " descriptors of unknown size");
    CHECK_FALSE(with(kElement, 4).empty());
    CHECK(with(kBranching, 0) == " branching is not in 2..20");
    CHECK(with(kCodec, 2) == " unknown codec");
    CHECK(with(kNodes, 0xffffffff) == " the sizes do not fit together");
    CHECK_FALSE(with(kNodes, 0).empty());
    CHECK_FALSE(with(kNodes, small_vocabulary().tables().nodes() - 1).empty());
  }
  const std::string mapped = saved(small_vocabulary(), VocabularyFormat::kMapped);
  CHECK(complaint(forged(mapped, [](std::string& f) { put_number(f, kTables, 0, 4); })) ==
        " the nodes are no tree");
  CHECK(complaint(forged(mapped, [](std::string& f) { put_number(f, kTables + 8, ~0U, 4); })) ==
        " a node has too many children");
}

// Of three words, two below a node, with a descriptor of ones.
std::string text_of(const std::string& header, const std::vector<std::string>& lines) {
  std::string text = header + "\n";
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

std::string node(int parent, int leaf, const std::string& weight = "0.5", int numbers = 128) {
  std::string line = std::to_string(parent) + " " + std::to_string(leaf);
  for (int i = 0; i < numbers; ++i) line += i % 2 == 0 ? " 0.125" : " 0";
  return line + " " + weight;
}

TEST_CASE("DBoW2's text is read in the order in which DBoW2 writes it") {
  // Nodes 1, 2 below the root; 3, 4 below 1; 5, 6 below 2. DBoW2 goes down before it goes on.
  const std::vector<std::string> lines{node(0, 0, "0"),   node(0, 0, "0"),   node(1, 1, "1.5"),
                                       node(1, 1, "2.5"), node(2, 1, "3.5"), node(2, 1, "4.5")};
  // Two blanks in the header are DBoW2's.
  const TempFolder folder;
  const auto path = folder.path() / "voc.txt";
  std::ofstream(path) << text_of("10 6  0 0", lines);
  const Vocabulary vocabulary = load_vocabulary(path, DescriptorKind::kPlainSift);
  CHECK(vocabulary.words() == 4);
  CHECK(vocabulary.depth() == 2);
  CHECK(vocabulary.tables().weights[3] == 1.5F);
  CHECK(vocabulary.tables().weights[6] == 4.5F);
  CHECK(vocabulary.tables().floats[3][0] == 0.125F);

  // The children of the first node come last: the tree is the same, in our order.
  std::ofstream(path) << text_of(
      "10 6 0 0", {node(0, 0, "0"), node(0, 0, "0"), node(2, 1, "3.5"), node(2, 1, "4.5"),
                   node(1, 1, "1.5"), node(1, 1, "2.5")});
  CHECK(same_tables(load_vocabulary(path), vocabulary));

  std::string dos = text_of("10 6 0 0", lines);
  for (std::size_t at = dos.find('\n'); at != dos.npos; at = dos.find('\n', at + 2)) {
    dos.replace(at, 1, "\r\n");
  }
  std::ofstream(path, std::ios::binary) << dos << "\r\n\n";
  CHECK(same_tables(load_vocabulary(path), vocabulary));
}

TEST_CASE("A text that is no vocabulary is refused with the line where it is not") {
  const std::string good = "10 6 0 0";
  const std::vector<std::string> leaf{node(0, 1), node(0, 1)};
  CHECK(complaint(text_of(good, leaf)).empty());
  CHECK(complaint("garbage\n") == "1: the number of branches is no number");
  CHECK(complaint(text_of("21 6 0 0", leaf)) == "1: the number of branches is out of range");
  CHECK(complaint(text_of("10 11 0 0", leaf)) == "1: the number of levels is out of range");
  CHECK(complaint(text_of("10 6 1 0", leaf)) == "1: only L1 scores (0) can be used");
  CHECK(complaint(text_of("10 6 0 3", leaf)) == "1: only TF-IDF weights (0) can be used");
  CHECK(complaint(text_of("10 6 0", leaf)) == "1: the line ends early");
  CHECK(complaint(text_of("10 6 0 0 orb", leaf)) == "1: unknown kind of descriptor");
  CHECK(complaint(good) == " no vocabulary, or one without words");
  CHECK(complaint(text_of(good, {leaf[0], node(2, 1)})) ==
        "3: the parent does not come before its child");
  CHECK(complaint(text_of(good, {leaf[0], node(1, 1)})) == "3: the parent is a word");
  CHECK(complaint(text_of(good, {leaf[0], node(-1, 1)})) == "3: the parent is no number");
  CHECK(complaint(text_of(good, {leaf[0], node(0, 2)})) == "3: the mark of a word is out of range");
  CHECK(complaint(text_of(good, {leaf[0], node(0, 0)})) ==
        "3: neither a word nor a node with children: is the file cut off?");
  CHECK(complaint(text_of(good, {leaf[0], "0 1 half a line"})) == "3: too short for a node");
  CHECK(complaint(text_of(good, {leaf[0], node(0, 1, "0.5", 127)})) == "3: the line ends early");
  CHECK(complaint(text_of(good, {leaf[0], node(0, 1, "0.5", 129)})) ==
        "3: a descriptor of more than 128 numbers");
  CHECK(complaint(text_of(good, {node(0, 1, "0.5", 32) + std::string(300, ' '), leaf[0]})) ==
        " is a vocabulary of ORB's descriptors of 32 bytes: one of SIFT's, of 128 numbers, is "
        "needed");
  CHECK(complaint(text_of(good, {leaf[0], node(0, 1, "nan")})) == "3: the weight is not finite");
  CHECK(complaint(text_of(good, {leaf[0], node(0, 1, "-1")})) == "3: the weight is negative");
  CHECK(complaint(text_of(good, {leaf[0], node(0, 1, "1e999")})) == "3: the weight is no number");
  std::string letters = node(0, 1);
  letters.replace(letters.find("0.125"), 5, "0.x25");
  CHECK(complaint(text_of(good, {leaf[0], letters})) ==
        "3: a number of the descriptor is no number");
  CHECK(complaint(text_of("2 6 0 0", {leaf[0], leaf[1], leaf[0]})) ==
        "4: the parent has too many children");
  CHECK(complaint(text_of("10 1 0 0", {node(0, 0), node(1, 1)})) ==
        " the tree is deeper than its levels");
  CHECK(complaint(text_of("10 6 0 0 root_sift", leaf)) ==
        "2: a byte of the descriptor is no number");
}

TEST_CASE("A text that is cut off is refused") {
  const std::string good = saved(small_vocabulary(), VocabularyFormat::kText);
  for (std::size_t size = 1; size + 1 < good.size(); size += 1 + size / 5) {
    const std::string reason = complaint(good.substr(0, size));
    INFO(size << " of " << good.size() << " bytes: " << reason);
    CHECK_FALSE(reason.empty());
  }
}

TEST_CASE("Vocabularies that cannot be written are reported") {
  const TempFolder folder;
  CHECK_THROWS_AS(save_vocabulary(folder.path() / "none" / "voc", small_vocabulary(),
                                  VocabularyFormat::kMapped),
                  OutputError);
}

}  // namespace
}  // namespace hybrid_slam
