"""The reference cases: exact and published numbers beside those computed here."""

from femimpact.validation.case import Case
from femimpact.validation.reference_cases import case_columns, markdown_table, run_validation

__all__ = ["Case", "case_columns", "markdown_table", "run_validation"]
