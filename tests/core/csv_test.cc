#include "core/csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::ElementsAre;

struct Row {
  long line;
  std::vector<std::string> fields;
};

std::vector<Row> ReadTable(const std::string& bytes) {
  const TempFolder folder;
  WriteBytes(folder / "table.csv", bytes);
  CsvReader table(folder / "table.csv", "Make it", "Expected a table");
  std::vector<Row> rows;
  while (table.Next()) {
    const auto fields = table.Fields();
    if (!fields) throw table.Error("a quote is open", "Close it");
    rows.push_back({table.line_number(), *fields});
  }
  return rows;
}

TEST(Csv, CountsLinesAndPassesByComments) {
  const auto rows =
      ReadTable("\xef\xbb\xbf# by hand\r\n a, b ,c\r\n\r\n \t\r\n  # between\r\n1,,\"\"");
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].line, 2);
  EXPECT_THAT(rows[0].fields, ElementsAre("a", "b", "c"));
  EXPECT_EQ(rows[1].line, 6);
  EXPECT_THAT(rows[1].fields, ElementsAre("1", "", ""));
}

TEST(Csv, QuotesHoldCommasBlanksAndQuotes) {
  const auto rows = ReadTable("\"a, b\" , \" c \",\"\"\"d\"\"\",e\"f\n\"#g\",,\n");
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_THAT(rows[0].fields, ElementsAre("a, b", " c ", "\"d\"", "e\"f"));
  EXPECT_THAT(rows[1].fields, ElementsAre("#g", "", ""));
}

TEST(Csv, CommentsMayStandBehindFieldsFromTheOneAskedFor) {
  const TempFolder folder;
  WriteBytes(folder / "table.csv",
             "name,x,label # the columns\n"
             "a #1.jpg,2,corner\t# left, \"upper\" one\n"
             "\"b\",3,\"# no comment\"  # one, two\n"
             "c#d,4#5, # nothing\n");
  CsvReader table(folder / "table.csv", "Make it", "Expected a table");
  table.CommentsFrom(1);
  std::vector<std::vector<std::string>> rows;
  while (table.Next()) rows.push_back(table.Fields().value_or(std::vector<std::string>()));
  EXPECT_THAT(rows,
              ElementsAre(ElementsAre("name", "x", "label"), ElementsAre("a #1.jpg", "2", "corner"),
                          ElementsAre("b", "3", "# no comment"), ElementsAre("c#d", "4#5", "")));
}

TEST(Csv, WhatIsWrittenIsReadBack) {
  const std::vector<std::string> fields = {"a.jpg", "b, c", "#d", "e\"f", " g ", "", "h#"};
  const auto rows = ReadTable(CsvLine(fields) + CsvLine({"", ""}));
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].fields, fields);
  EXPECT_THAT(rows[1].fields, ElementsAre("", ""));
}

TEST(Csv, PlainFieldsStandWithoutQuotes) {
  EXPECT_EQ(CsvLine({"a b.jpg", "1.5", "", "-2e-05"}), "a b.jpg,1.5,,-2e-05\n");
}

TEST(Csv, FieldsInQuotesGoOverLineEnds) {
  const std::vector<std::string> fields = {"a\nb, \"c\"\n\nd.jpg", "1"};
  const auto rows = ReadTable("x\n" + CsvLine(fields) + "last,\"\"\n");
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[1].fields, fields);
  EXPECT_EQ(rows[1].line, 2);
  EXPECT_EQ(rows[2].line, 6);
}

TEST(Csv, OpenQuoteHidesNoLineBelow) {
  const TempFolder folder;
  WriteBytes(folder / "table.csv", "\"b,c\nd,e\nf,g\n");
  CsvReader table(folder / "table.csv", "Make it", "Expected a table");
  ASSERT_TRUE(table.Next());
  EXPECT_FALSE(table.Fields());
  EXPECT_EQ(table.line_number(), 1);
  for (const long line : {2, 3}) {
    ASSERT_TRUE(table.Next());
    EXPECT_EQ(table.line_number(), line);
    EXPECT_TRUE(table.Fields());
  }
  EXPECT_FALSE(table.Next());
}

TEST(Csv, RefusesOpenQuotesWithTheirLine) {
  EXPECT_INPUT_ERROR(ReadTable("a\n\"b,c\n"), "line 2: a quote is open");
  EXPECT_INPUT_ERROR(ReadTable("\"b\" c,d\n"), "line 1: a quote is open");
}

TEST(Csv, RefusesWhatIsNoText) {
  EXPECT_INPUT_ERROR(ReadTable(std::string("a\nb\0c\n", 6)), "line 2: is not a line of a text");
  EXPECT_INPUT_ERROR(ReadTable(std::string(70000, 'a')), "line 1: is not a line of a text");
  EXPECT_INPUT_ERROR(CsvReader("/nonexistent/table.csv", "Make it", ""), "Make it");
}

TEST(Csv, AnEmptyFileHasNoRows) { EXPECT_TRUE(ReadTable("").empty()); }

}  // namespace
}  // namespace roomtex
