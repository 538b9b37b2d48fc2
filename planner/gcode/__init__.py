"""The control's language: addresses, words, blocks, programs, dialects, reader and writer; meaning is elsewhere."""

from planner.gcode.codes import code_of
from planner.gcode.dialect import DIALECTS, FANUC, GENERIC, HEIDENHAIN, LINUXCNC, SINUMERIK, Dialect
from planner.gcode.expression import Binary, Call, Expression, Name, Number, Text, Unary
from planner.gcode.lexer import SyntaxProblem
from planner.gcode.modal import GROUP_OF, ModalGroup
from planner.gcode.program import Block, Program
from planner.gcode.reader import directory_of, header_name, read_block, read_blocks, read_program
from planner.gcode.words import Word, decimal_text, list_word, number_word, rounded_units, units_above, value_text
from planner.gcode.writer import write_block, write_expression, write_word, write_words

__all__ = [
    "DIALECTS",
    "FANUC",
    "GENERIC",
    "GROUP_OF",
    "HEIDENHAIN",
    "LINUXCNC",
    "SINUMERIK",
    "Binary",
    "Block",
    "Call",
    "Dialect",
    "Expression",
    "ModalGroup",
    "Name",
    "Number",
    "Program",
    "SyntaxProblem",
    "Text",
    "Unary",
    "Word",
    "code_of",
    "decimal_text",
    "directory_of",
    "header_name",
    "list_word",
    "number_word",
    "read_block",
    "read_blocks",
    "read_program",
    "rounded_units",
    "units_above",
    "value_text",
    "write_block",
    "write_expression",
    "write_word",
    "write_words",
]
