.rge a
.fnord 3
.period
        .ones
