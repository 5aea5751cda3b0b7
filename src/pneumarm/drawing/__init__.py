"""The arm as it is drawn everywhere: the report, films, Gymnasium, notebooks and the live page; and the colours."""
