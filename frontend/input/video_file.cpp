#include "frontend/input/video_file.h"

#include <algorithm>
#include <cctype>

#include "frontend/input/image_decoders.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

// The name as ffmpeg takes it for a file, whatever is in it.
std::string file_argument(const fs::path& path) { return "file:" + path.string(); }

std::string ask_ffprobe(const fs::path& path, const std::string& entries) {
  std::string text;
  ChildOutput probe({"ffprobe", "-v", "error", "-select_streams", "v:0", "-show_entries", entries,
                     "-of", "csv=print_section=0", file_argument(path)});
  if (!probe.read_to_end(text)) throw InputError(path.string() + ": is no video that can be read");
  return text;
}

}  // namespace

bool is_video_name(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr const char* kExtensions[] = {".avi", ".m4v", ".mkv", ".mov", ".mp4",  ".mpeg",
                                         ".mpg", ".mts", ".ogv", ".ts",  ".webm", ".wmv"};
  return std::find(std::begin(kExtensions), std::end(kExtensions), extension) !=
         std::end(kExtensions);
}

VideoFile::VideoFile(const fs::path& path) : path_(path) {
  if (!fs::exists(path)) throw InputError(path.string() + ": no such file");
  try {
    read_header();
  } catch (const InputError& error) {
    const std::string reason = error.what();
    if (!reason.starts_with("ff")) throw;
    throw InputError(path.string() + ": videos are read by ffmpeg: " + reason);
  }
}

// Times are those of the packets: these come as they were coded, not as they are shown.
void VideoFile::read_header() {
  const std::string size = ask_ffprobe(path_, "stream=width,height");
  const std::vector<std::string_view> sides =
      split_fields(std::string_view(size).substr(0, size.find('\n')), ',');
  if (sides.size() < 2) throw InputError(path_.string() + ": holds no video");
  size_ = {static_cast<int>(parse_number(sides[0], path_, 1)),
           static_cast<int>(parse_number(sides[1], path_, 1))};
  const std::string packets = ask_ffprobe(path_, "packet=pts_time");
  for (const std::string_view field : split_fields(packets, '\n')) {
    const std::string_view time = field.substr(0, field.find(','));
    if (time.empty()) continue;
    if (time == "N/A") {
      throw InputError(path_.string() + ": the video's frames have no times; make images of it");
    }
    times_.push_back(parse_number(time, path_, 1));
  }
  if (times_.empty()) throw InputError(path_.string() + ": the video holds no frames");
  std::sort(times_.begin(), times_.end());
  const double first = times_.front();
  for (double& time : times_) time -= first;
}

// The calibration is that of the stored pixels: no rotation. No frame is left out or doubled.
void VideoFile::start() {
  decoder_.reset();
  decoder_ = std::make_unique<ChildOutput>(std::vector<std::string>{
      "ffmpeg", "-v", "quiet", "-noautorotate", "-i", file_argument(path_), "-map", "0:v:0",
      "-vsync", "passthrough", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"});
  next_ = 0;
}

GrayImage VideoFile::read(std::size_t frame, GrayChannel channel) {
  const std::string name = path_.string() + ": frame " + std::to_string(frame);
  if (frame >= times_.size()) throw InputError(name + ": the video has no such frame");
  if (!decoder_ || frame < next_) start();
  const std::size_t pixels =
      static_cast<std::size_t>(size_.width) * static_cast<std::size_t>(size_.height);
  std::vector<std::uint8_t> colors(3 * pixels);
  for (; next_ <= frame; ++next_) {
    if (decoder_->read(colors) < colors.size()) throw InputError(name + " cannot be decoded");
  }
  GrayImage image{size_.width, size_.height, {}};
  image.pixels.reserve(pixels);
  for (std::size_t i = 0; i < colors.size(); i += 3) {
    image.pixels.push_back(gray_of(colors[i], colors[i + 1], colors[i + 2], channel));
  }
  return image;
}

}  // namespace hybrid_slam
