#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

// What the fuzz targets share. Each is one source with one read_input(); fuzz_main.cpp hands it
// inputs and finds at fault whatever is thrown but an InputError of one line.
namespace hybrid_slam {

void read_input(std::string_view input);

// The folder of this process for files; it is gone at a regular end.
const std::filesystem::path& fuzz_folder();

// Writes the input as a file of this name there, over an older one.
std::filesystem::path input_file(std::string_view input, const std::string& name = "input");

// The same for readers of several files: an input is their contents, with this line between them.
// Contents that are missing are empty; "-" is a file that is not there.
inline constexpr std::string_view kNextFile = "\n--- next file ---\n";
std::vector<std::filesystem::path> input_files(std::string_view input,
                                               std::initializer_list<std::string> names);

// Runs a reader that is tried on the same input as others are: its InputError is an answer.
void try_reading(const std::function<void()>& read);

// For custom mutators: these bytes, changed by libFuzzer, at most `most` of them.
std::string changed(std::string bytes, std::size_t most);

// Copies a custom mutator's result to where libFuzzer wants it; 0 if it does not fit.
std::size_t hand_over(std::string_view result, std::uint8_t* data, std::size_t most);

}  // namespace hybrid_slam
