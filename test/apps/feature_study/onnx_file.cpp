#include "test/apps/feature_study/onnx_file.h"

#include <cstdint>
#include <cstring>

namespace hybrid_slam {
namespace {

// One message of Protocol Buffers: fields by their numbers.
class Message {
 public:
  Message& number(unsigned field, std::uint64_t value) {
    varint(field << 3U);
    varint(value);
    return *this;
  }
  Message& bytes(unsigned field, const std::string& value) {
    varint(field << 3U | 2U);
    varint(value.size());
    text_ += value;
    return *this;
  }
  Message& message(unsigned field, const Message& value) { return bytes(field, value.text_); }
  const std::string& text() const { return text_; }

 private:
  void varint(std::uint64_t value) {
    for (; value > 127; value >>= 7U) text_ += static_cast<char>((value & 127U) | 128U);
    text_ += static_cast<char>(value);
  }
  std::string text_;
};

constexpr unsigned kFloat = 1;           // TensorProto.DataType
constexpr unsigned kInt = 2, kInts = 7;  // AttributeProto.AttributeType

Message tensor(const OnnxTensor& from) {
  Message message;
  for (const int size : from.shape) message.number(1, static_cast<std::uint64_t>(size));
  std::string raw(from.values.size() * sizeof(float), '\0');
  std::memcpy(raw.data(), from.values.data(), raw.size());
  return message.number(2, kFloat).bytes(8, from.name).bytes(9, raw);
}

Message value_info(const OnnxTensor& from) {
  Message shape;
  for (const int size : from.shape) {
    shape.message(1, Message().number(1, static_cast<std::uint64_t>(size)));
  }
  return Message()
      .bytes(1, from.name)
      .message(2, Message().message(1, Message().number(1, kFloat).message(2, shape)));
}

Message node(const OnnxNode& from) {
  Message message;
  for (const std::string& input : from.inputs) message.bytes(1, input);
  for (const std::string& output : from.outputs) message.bytes(2, output);
  message.bytes(4, from.operation);
  for (const auto& [name, values] : from.attributes) {
    Message attribute;
    attribute.bytes(1, name);
    for (const int value : values) attribute.number(8, static_cast<std::uint64_t>(value));
    message.message(5, attribute.number(20, kInts));
  }
  for (const auto& [name, value] : from.numbers) {
    message.message(
        5, Message().bytes(1, name).number(3, static_cast<std::uint64_t>(value)).number(20, kInt));
  }
  return message;
}

}  // namespace

std::string onnx_bytes(const OnnxGraph& graph) {
  Message content;
  for (const OnnxNode& from : graph.nodes) content.message(1, node(from));
  content.bytes(2, "test");
  for (const OnnxTensor& from : graph.constants) content.message(5, tensor(from));
  for (const OnnxTensor& from : graph.inputs) content.message(11, value_info(from));
  for (const OnnxTensor& from : graph.outputs) content.message(12, value_info(from));
  return Message()
      .number(1, 6)
      .message(7, content)
      .message(8, Message().bytes(1, "").number(2, 11))
      .text();
}

OnnxGraph block_means(int batch, int width, int height, int block_width, int block_height) {
  const int length = width / block_width * (height / block_height);
  return {
      {{"AveragePool",
        {"patch"},
        {"means"},
        {{"kernel_shape", {block_height, block_width}}, {"strides", {block_height, block_width}}},
        {}},
       {"Flatten", {"means"}, {"descriptor"}, {}, {{"axis", 1}}}},
      {},
      {{"patch", {batch, 1, height, width}, {}}},
      {{"descriptor", {batch, length}, {}}}};
}

OnnxGraph cell_detector(int width, int height, float none) {
  OnnxTensor pixels{"pixels", {65, 1, 8, 8}, std::vector<float>(65 * 64, 0)};
  OnnxTensor bias{"bias", {65}, std::vector<float>(65, 0)};
  for (std::size_t i = 0; i < 64; ++i) pixels.values[i * 64 + i] = 1;
  bias.values.back() = none;
  OnnxTensor first{"first", {2, 1, 8, 8}, std::vector<float>(2 * 64, 0)};
  first.values.front() = 1;
  const OnnxTensor one{"one", {2}, {0, 1}};
  const std::vector<std::pair<std::string, std::vector<int>>> by_cells{{"kernel_shape", {8, 8}},
                                                                       {"strides", {8, 8}}};
  return {
      {{"Conv", {"image", "pixels", "bias"}, {"semi"}, by_cells, {}},
       {"Conv", {"image", "first", "one"}, {"desc"}, by_cells, {}}},
      {pixels, bias, first, one},
      {{"image", {1, 1, height, width}, {}}},
      {{"semi", {1, 65, height / 8, width / 8}, {}}, {"desc", {1, 2, height / 8, width / 8}, {}}}};
}

OnnxGraph map_detector(int width, int height) {
  const OnnxTensor same{"same", {1, 1, 1, 1}, {1}};
  const OnnxTensor twice{"twice", {3, 1, 1, 1}, {1, 2, 3}};
  const std::vector<std::pair<std::string, std::vector<int>>> by_pixels{{"kernel_shape", {1, 1}}};
  return {{{"Conv", {"image", "same"}, {"scores"}, by_pixels, {}},
           {"Conv", {"image", "twice"}, {"desc"}, by_pixels, {}}},
          {same, twice},
          {{"image", {1, 1, height, width}, {}}},
          {{"scores", {1, 1, height, width}, {}}, {"desc", {1, 3, height, width}, {}}}};
}

}  // namespace hybrid_slam
