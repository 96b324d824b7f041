#include "capture/calibration/board.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <utility>

#include "core/option_fields.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr int kFewestSquares = 3, kMostSquares = 100;
constexpr double kLargestSquare = 1;  // metres; beyond are millimetres

struct Dictionary {
  const char* name;
  int num_markers;
};
// In the order of cv::aruco::PREDEFINED_DICTIONARY_NAME.
constexpr Dictionary kDictionaries[] = {
    {"DICT_4X4_50", 50},        {"DICT_4X4_100", 100},         {"DICT_4X4_250", 250},
    {"DICT_4X4_1000", 1000},    {"DICT_5X5_50", 50},           {"DICT_5X5_100", 100},
    {"DICT_5X5_250", 250},      {"DICT_5X5_1000", 1000},       {"DICT_6X6_50", 50},
    {"DICT_6X6_100", 100},      {"DICT_6X6_250", 250},         {"DICT_6X6_1000", 1000},
    {"DICT_7X7_50", 50},        {"DICT_7X7_100", 100},         {"DICT_7X7_250", 250},
    {"DICT_7X7_1000", 1000},    {"DICT_ARUCO_ORIGINAL", 1024}, {"DICT_APRILTAG_16h5", 30},
    {"DICT_APRILTAG_25h9", 35}, {"DICT_APRILTAG_36h10", 2320}, {"DICT_APRILTAG_36h11", 587}};

const Dictionary* FindDictionary(const std::string& name) {
  for (const Dictionary& dictionary : kDictionaries) {
    if (name == dictionary.name) return &dictionary;
  }
  return nullptr;
}

// "9x6" as {9, 6}.
std::optional<std::pair<int, int>> ParseSize(const std::string& text) {
  const size_t cross = text.find_first_of("xX");
  if (cross == std::string::npos) return std::nullopt;
  const auto number = [](const std::string& digits) {
    const bool plain = !digits.empty() && digits.size() <= 4 &&
                       std::all_of(digits.begin(), digits.end(),
                                   [](unsigned char c) { return std::isdigit(c) != 0; });
    return plain ? std::stoi(digits) : -1;
  };
  const int columns = number(text.substr(0, cross)), rows = number(text.substr(cross + 1));
  if (columns < 0 || rows < 0) return std::nullopt;
  return std::make_pair(columns, rows);
}

}  // namespace

std::vector<std::string> BoardOptions::Dictionaries() {
  std::vector<std::string> names;
  for (const Dictionary& one : kDictionaries) names.push_back(one.name);
  return names;
}

void BoardOptions::Declare(OptionFields* fields) {
  const bool charuco = type == "charuco";
  const std::string what = charuco ? "squares" : "inner corners";
  const auto counts = ParseSize(size);
  const int least = charuco ? kFewestSquares + 1 : kFewestSquares;
  fields
      ->Text("board", &size,
             "COLUMNSxROWS: inner corners of a checkerboard (where four squares meet; 9x6 "
             "for 10x7 squares), squares of a ChArUco board.")
      .Required();
  fields->Require(counts.has_value(), "--board is \"" + size + "\", expected COLUMNSxROWS of " +
                                          what + ", such as 9x6" +
                                          (charuco ? "" : " for a board of 10x7 squares"));
  fields->Require(!counts || (std::min(counts->first, counts->second) >= least &&
                              std::max(counts->first, counts->second) <= kMostSquares),
                  "--board is \"" + size + "\", expected " + std::to_string(least) + " to " +
                      std::to_string(kMostSquares) + " " + what + " each way");
  fields
      ->Number("square", &square,
               "Side of a square, metres. The intrinsics do not depend on it, only the "
               "distances in the report do.")
      .Positive()
      .AtMost(kLargestSquare)
      .Says("must be above 0 and at most 1: the side of a square in metres, 25 mm are 0.025");
  fields->Choice("board_type", &type, Types(),
                 "A checkerboard must be seen whole; of a ChArUco board a part is enough.");
  fields->Number("marker", &marker,
                 "Side of a ChArUco marker with its black border, metres (in proportion to "
                 "--square).");
  fields->Require(
      !charuco || (marker > 0 && marker < square),
      "--marker must be positive and less than --square: the side of a marker in metres, black "
      "border included");
  fields
      ->Choice("dictionary", &dictionary, Dictionaries(),
               "Dictionary of the ChArUco markers, OpenCV's name.")
      .Says("is \"" + dictionary + "\", expected OpenCV's name of one");
  const Dictionary* const markers = FindDictionary(dictionary);
  const int num_markers = counts ? counts->first * counts->second / 2 : 0;
  fields->Require(!charuco || markers == nullptr || num_markers <= markers->num_markers,
                  "--board has " + std::to_string(num_markers) + " markers, but " + dictionary +
                      " only " + std::to_string(markers == nullptr ? 0 : markers->num_markers));
  fields->Require(charuco || marker == 0, "--marker is for --board_type charuco");
}

std::vector<std::string> BoardOptions::Problems() const { return ProblemsOf(*this); }

std::string Board::Name() const {
  const auto size = [](int c, int r) { return std::to_string(c) + "x" + std::to_string(r); };
  return type == BoardType::kCharuco
             ? "ChArUco board of " + size(columns + 1, rows + 1) + " squares"
             : "checkerboard of " + size(columns, rows) + " inner corners";
}

Board MakeBoard(const BoardOptions& options) {
  Board board;
  board.type = options.type == "charuco" ? BoardType::kCharuco : BoardType::kCheckerboard;
  const auto counts = ParseSize(options.size).value();
  const int less = board.type == BoardType::kCharuco ? 1 : 0;
  board.columns = counts.first - less;
  board.rows = counts.second - less;
  board.square = options.square;
  board.marker = options.marker;
  board.dictionary = static_cast<int>(FindDictionary(options.dictionary) - kDictionaries);
  return board;
}

}  // namespace roomtex
