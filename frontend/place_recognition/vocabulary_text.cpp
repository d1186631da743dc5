#include "frontend/place_recognition/vocabulary_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <memory>
#include <numeric>
#include <stdexcept>

#include "cameras/files/input_error.h"

namespace hybrid_slam {
namespace {

constexpr std::string_view kRootSiftName = "root_sift";
constexpr std::string_view kPlainSiftName = "plain_sift";
constexpr std::size_t kDimensions = std::tuple_size_v<Descriptor>;
constexpr std::size_t kShortestLine = 2 * (kDimensions + 3);  // "0 1 0 0 ... 0\n"
constexpr std::size_t kMaxLines = std::size_t{1} << 30;

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

// The fields of one line.
class Line {
 public:
  Line(std::string_view text, std::size_t number, const std::string& name)
      : text_(text), number_(number), name_(name) {}

  bool at_end() {
    while (!text_.empty() && is_blank(text_.front())) text_.remove_prefix(1);
    return text_.empty();
  }

  std::string_view field() {
    if (at_end()) fail("the line ends early");
    std::size_t size = 0;
    while (size < text_.size() && !is_blank(text_[size])) ++size;
    const std::string_view field = text_.substr(0, size);
    text_.remove_prefix(size);
    return field;
  }

  template <typename T>
  T number(const char* what) {
    const std::string_view text = field();
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) {
      fail(std::string(what) + " is no number");
    }
    if constexpr (std::is_floating_point_v<T>) {
      if (!std::isfinite(value)) fail(std::string(what) + " is not finite");
    }
    return value;
  }

  // A whole number from `low` to `high`.
  int integer(const char* what, int low, int high) {
    const int value = number<int>(what);
    if (value < low || value > high) fail(std::string(what) + " is out of range");
    return value;
  }

  [[noreturn]] void fail(const std::string& reason) const {
    throw InputError(name_ + ":" + std::to_string(number_) + ": " + reason);
  }

 private:
  std::string_view text_;
  std::size_t number_;
  const std::string& name_;
};

struct Lines {
  std::vector<std::size_t> begin;  // of each node's line, then the end of the text
  std::size_t header_end = 0;
};

// Lines of nodes; blank ones may follow the last.
Lines split_lines(std::string_view text, const std::string& name) {
  Lines lines;
  lines.header_end = std::min(text.find('\n'), text.size());
  std::size_t last = text.size();
  while (last > lines.header_end && (is_blank(text[last - 1]) || text[last - 1] == '\n')) --last;
  std::size_t at = lines.header_end + 1;
  while (at < last) {
    lines.begin.push_back(at);
    const void* end = std::memchr(text.data() + at, '\n', last - at);
    if (end == nullptr) break;
    at = static_cast<std::size_t>(static_cast<const char*>(end) - text.data()) + 1;
  }
  lines.begin.push_back(last + 1);
  if (lines.begin.size() < 2) throw InputError(name + ": no vocabulary, or one without words");
  if (lines.begin.size() > kMaxLines) throw InputError(name + ": too many lines");
  return lines;
}

// What a file is that is no vocabulary of SIFT as text; empty if nothing tells.
std::string other_kind(std::string_view text) {
  using namespace std::string_view_literals;
  struct Kind {
    std::string_view begin;
    const char* what;
  };
  constexpr std::array kKinds{Kind{"\x1f\x8b"sv, "is compressed (gzip): unpack it first"},
                              Kind{"BZh"sv, "is compressed (bzip2): unpack it first"},
                              Kind{"\xfd"
                                   "7zXZ"sv,
                                   "is compressed (xz): unpack it first"},
                              Kind{"\x28\xb5\x2f\xfd"sv, "is compressed (zstd): unpack it first"},
                              Kind{"PK\x03\x04"sv, "is a zip archive: unpack it first"},
                              Kind{"%YAML"sv, "is a vocabulary as YAML: DBoW2's text is read"},
                              Kind{"<?xml"sv, "is a vocabulary as XML: DBoW2's text is read"}};
  for (const Kind& kind : kKinds) {
    if (text.starts_with(kind.begin)) return kind.what;
  }
  if (text.size() > 262 && text.substr(257, 5) == "ustar")
    return "is a tar archive: unpack it first";
  if (text.substr(0, 64).find('\0') != std::string_view::npos) {
    return "is a binary file, perhaps of ORB-SLAM, DBoW3 or fbow: DBoW2's text is read, and what "
           "vocabulary_trainer writes";
  }
  return {};
}

// Of ORB, as ORB-SLAM's ORBvoc.txt: a node's line has parent, mark, 32 bytes and the weight.
bool is_of_orb(std::string_view text) {
  constexpr int kFields = 35;
  const std::size_t begin = std::min(text.find('\n'), text.size() - 1) + 1;
  const std::string_view node = text.substr(begin, text.find('\n', begin) - begin);
  int fields = 0;
  for (std::size_t i = 0; i < node.size(); ++i) {
    if (!is_blank(node[i]) && (i == 0 || is_blank(node[i - 1]))) ++fields;
  }
  return fields == kFields;
}

class TextReader {
 public:
  TextReader(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  Vocabulary read() {
    read_header(text_.substr(0, std::min(text_.find('\n'), text_.size())));
    lines_ = split_lines(text_, name_);
    read_tree();
    sort_breadth_first();
    read_nodes();
    return finish();
  }

 private:
  struct Content {
    std::vector<NodeId> first_child;
    std::vector<float> weights;
    std::vector<Descriptor> bytes;
    std::vector<FloatDescriptor> floats;
  };

  std::size_t nodes() const { return lines_.begin.size(); }  // with the root, without its line

  Line line_of(std::size_t node) const {
    const std::size_t begin = lines_.begin[node - 1];
    return Line(text_.substr(begin, lines_.begin[node] - 1 - begin), node + 1, name_);
  }

  void read_header(std::string_view text) {
    Line line(text, 1, name_);
    tables_.branching = line.integer("the number of branches", 2, kMaxBranching);
    tables_.levels = line.integer("the number of levels", 1, kMaxLevels);
    if (line.number<int>("the scoring") != 0) line.fail("only L1 scores (0) can be used");
    if (line.number<int>("the weighting") != 0) line.fail("only TF-IDF weights (0) can be used");
    tables_.kind = DescriptorKind::kPlainSift;
    if (line.at_end()) return;
    const std::string_view kind = line.field();
    if (kind == kRootSiftName) {
      tables_.kind = DescriptorKind::kRootSift;
    } else if (kind != kPlainSiftName) {
      line.fail("unknown kind of descriptor");
    }
  }

  // Parents and leaves; nodes as the file counts them.
  void read_tree() {
    parent_.assign(nodes(), 0);
    children_.assign(nodes(), 0);
    std::vector<char> leaf(nodes(), 0);
    for (std::size_t node = 1; node < nodes(); ++node) {
      if (lines_.begin[node] - lines_.begin[node - 1] < kShortestLine) {
        line_of(node).fail("too short for a node");
      }
      Line line = line_of(node);
      const auto parent = line.number<std::uint32_t>("the parent");
      leaf[node] = static_cast<char>(line.integer("the mark of a word", 0, 1));
      if (parent >= node) line.fail("the parent does not come before its child");
      if (leaf[parent]) line.fail("the parent is a word");
      if (++children_[parent] > static_cast<NodeId>(tables_.branching)) {
        line.fail("the parent has too many children");
      }
      parent_[node] = parent;
    }
    for (std::size_t node = 1; node < nodes(); ++node) {
      if (!leaf[node] && children_[node] == 0) {
        line_of(node).fail("neither a word nor a node with children: is the file cut off?");
      }
    }
  }

  // place_: where each node goes; siblings keep their order.
  void sort_breadth_first() {
    std::vector<std::size_t> begin(nodes() + 1, 0);  // of the children in `children`
    for (std::size_t node = 0; node < nodes(); ++node) {
      begin[node + 1] = begin[node] + children_[node];
    }
    std::vector<NodeId> children(nodes() - 1);
    std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
    for (std::size_t node = 1; node < nodes(); ++node) {
      children[next[parent_[node]]++] = static_cast<NodeId>(node);
    }
    std::vector<NodeId> order{0};
    order.reserve(nodes());
    content_->first_child.reserve(nodes() + 1);
    for (std::size_t i = 0; i < order.size(); ++i) {
      content_->first_child.push_back(static_cast<NodeId>(order.size()));
      for (std::size_t k = begin[order[i]]; k < begin[order[i] + 1]; ++k) {
        order.push_back(children[k]);
      }
    }
    content_->first_child.push_back(static_cast<NodeId>(order.size()));
    place_.resize(nodes());
    for (std::size_t i = 0; i < order.size(); ++i) place_[order[i]] = static_cast<NodeId>(i);
  }

  void read_nodes() {
    const bool bytes = tables_.kind == DescriptorKind::kRootSift;
    content_->weights.assign(nodes(), 0);
    bytes ? content_->bytes.resize(nodes()) : content_->floats.resize(nodes());
    for (std::size_t node = 1; node < nodes(); ++node) {
      Line line = line_of(node);
      line.field();
      line.field();
      const NodeId place = place_[node];
      for (std::size_t k = 0; k < kDimensions; ++k) {
        if (bytes) {
          content_->bytes[place][k] =
              static_cast<std::uint8_t>(line.integer("a byte of the descriptor", 0, 255));
        } else {
          content_->floats[place][k] = line.number<float>("a number of the descriptor");
        }
      }
      content_->weights[place] = line.number<float>("the weight");
      if (content_->weights[place] < 0) line.fail("the weight is negative");
      if (!line.at_end()) line.fail("a descriptor of more than 128 numbers");
    }
  }

  Vocabulary finish() {
    tables_.first_child = content_->first_child;
    tables_.weights = content_->weights;
    tables_.bytes = content_->bytes;
    tables_.floats = content_->floats;
    const std::string wrong = tables_.validate();
    if (!wrong.empty()) throw InputError(name_ + ": " + wrong);
    return Vocabulary(tables_, content_);
  }

  std::string_view text_;
  const std::string& name_;
  Lines lines_;
  VocabularyTables tables_;
  std::vector<NodeId> parent_, children_;  // children_: their number
  std::vector<NodeId> place_;
  std::shared_ptr<Content> content_ = std::make_shared<Content>();
};

void append_number(std::string* line, float value) {
  char digits[32];
  const auto [end, error] = std::to_chars(digits, digits + sizeof(digits), value);
  line->append(digits, end).push_back(' ');
}

}  // namespace

Vocabulary read_vocabulary_text(std::string_view text, const std::string& name) {
  std::string other = other_kind(text);
  if (other.empty() && !text.empty() && is_of_orb(text)) {
    other =
        "is a vocabulary of ORB's descriptors of 32 bytes: one of SIFT's, of 128 numbers, is "
        "needed";
  }
  if (!other.empty()) throw InputError(name + ": " + other);
  return TextReader(text, name).read();
}

void write_vocabulary_text(const Vocabulary& vocabulary,
                           const std::function<void(std::string_view)>& write) {
  const VocabularyTables& tables = vocabulary.tables();
  const bool root_sift = tables.kind == DescriptorKind::kRootSift;
  if (!root_sift && tables.kind != DescriptorKind::kPlainSift) {
    throw std::logic_error("vocabulary: no text for this kind of descriptors");
  }
  write(std::to_string(tables.branching) + " " + std::to_string(tables.levels) + " 0 0 " +
        std::string(root_sift ? kRootSiftName : kPlainSiftName) + "\n");
  for (NodeId parent = 0; parent < tables.nodes(); ++parent) {
    for (NodeId node = tables.first_child[parent]; node < tables.first_child[parent + 1]; ++node) {
      const bool word = tables.first_child[node] == tables.first_child[node + 1];
      std::string line = std::to_string(parent) + (word ? " 1 " : " 0 ");
      for (std::size_t k = 0; k < kDimensions; ++k) {
        append_number(&line, tables.bytes.empty() ? tables.floats[node][k]
                                                  : static_cast<float>(tables.bytes[node][k]));
      }
      append_number(&line, tables.weights[node]);
      line.back() = '\n';
      write(line);
    }
  }
}

}  // namespace hybrid_slam
