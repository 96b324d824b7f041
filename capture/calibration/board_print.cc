#include "capture/calibration/board_print.h"

#include <algorithm>
#include <vector>

#include <fmt/core.h>
#include <opencv2/aruco.hpp>
#include <opencv2/core/mat.hpp>

#include "capture/calibration/board_charuco.h"
#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {
namespace {

constexpr double kPointsPerMetre = 72 / 0.0254;
constexpr double kBoardMargin = 0.010;  // metres
constexpr double kTextLine = 0.008;     // metres, below the board
constexpr double kLongest = 5;          // metres; PDF's own limit is 200 inches

struct Page {
  double width, height;  // metres
};

Page PageFor(double width, double height) {
  const double w = width + 2 * kBoardMargin, h = height + 2 * kBoardMargin + kTextLine;
  for (const Page& a : {Page{0.210, 0.297}, Page{0.297, 0.420}, Page{0.420, 0.594},
                        Page{0.594, 0.841}, Page{0.841, 1.189}}) {
    if (w <= a.width && h <= a.height) return a;
    if (w <= a.height && h <= a.width) return {a.height, a.width};
  }
  return {w, h};
}

// Black rectangles in points, y upwards from the lower left, as PDF has it.
class Drawing {
 public:
  Drawing(double left, double top) : left_(left), top_(top) {}
  // Metres from the upper left of the board.
  void Add(double x, double y, double width, double height) {
    text_ += fmt::format("{:.4f} {:.4f} {:.4f} {:.4f} re\n", kPointsPerMetre * (left_ + x),
                         kPointsPerMetre * (top_ - y - height), kPointsPerMetre * width,
                         kPointsPerMetre * height);
  }
  std::string Filled() const { return "0 g\n" + text_ + "f\n"; }

 private:
  double left_, top_;
  std::string text_;
};

void AddMarkers(const Board& board, Drawing* drawing) {
  const cv::Ptr<cv::aruco::Dictionary> dictionary =
      cv::aruco::getPredefinedDictionary(board.dictionary);
  const int cells = dictionary->markerSize + 2;  // with the black border
  const double cell = board.marker / cells;
  for (int id = 0; true; ++id) {
    const std::vector<Eigen::Vector2d> corners = MarkerOnBoard(board, {}, id);
    if (corners.empty()) return;
    // From the first inner corner to the board's own.
    const Eigen::Vector2d first = corners[0] + Eigen::Vector2d(board.square, board.square);
    cv::Mat1b bits;
    cv::aruco::drawMarker(dictionary, id, cells, bits, 1);
    for (int row = 0; row < cells; ++row) {
      for (int column = 0; column < cells; ++column) {
        if (bits(row, column) > 0) continue;
        drawing->Add(first.x() + column * cell, first.y() + row * cell, cell, cell);
      }
    }
  }
}

std::string Pdf(const Page& page, const std::string& content) {
  const std::string objects[] = {
      "<< /Type /Catalog /Pages 2 0 R >>", "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
      fmt::format("<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:.3f} {:.3f}] /Contents 4 0 R "
                  "/Resources << /Font << /F 5 0 R >> >> >>",
                  kPointsPerMetre * page.width, kPointsPerMetre * page.height),
      fmt::format("<< /Length {} >>\nstream\n{}\nendstream", content.size(), content),
      "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>"};
  std::string pdf = "%PDF-1.4\n", table;
  int number = 0;
  for (const std::string& object : objects) {
    table += fmt::format("{:010d} 00000 n \n", pdf.size());
    pdf += fmt::format("{} 0 obj\n{}\nendobj\n", ++number, object);
  }
  const size_t at = pdf.size();
  pdf += fmt::format("xref\n0 {}\n0000000000 65535 f \n{}", number + 1, table);
  return pdf +
         fmt::format("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n", number + 1, at);
}

}  // namespace

void WriteBoardPdf(const Board& board, const std::string& path) {
  const int columns = board.columns + 1, rows = board.rows + 1;  // squares
  const double width = columns * board.square, height = rows * board.square;
  if (std::max(width, height) > kLongest) {
    throw InputError(path, "", fmt::format("would be {:.1f} x {:.1f} m large", width, height),
                     "Give a smaller --square (metres: 0.025 is 25 mm)");
  }
  const Page page = PageFor(width, height);
  const double left = (page.width - width) / 2;
  const double bottom = (page.height - height + kTextLine) / 2;
  Drawing drawing(left, bottom + height);
  for (int row = 0; row < rows; ++row) {
    for (int column = row % 2; column < columns; column += 2) {
      drawing.Add(column * board.square, row * board.square, board.square, board.square);
    }
  }
  if (board.type == BoardType::kCharuco) AddMarkers(board, &drawing);
  const std::string line = fmt::format(
      "{}, squares of {:g} mm. Print at 100 %, measure, and glue it onto something flat.",
      board.Name(), 1000 * board.square);
  OutputFile file(path);
  file.stream() << Pdf(
      page, drawing.Filled() + fmt::format("BT /F 8 Tf {:.3f} {:.3f} Td ({}) Tj ET",
                                           kPointsPerMetre * left,
                                           kPointsPerMetre * (bottom - kTextLine), line));
  file.Commit();
}

}  // namespace roomtex
