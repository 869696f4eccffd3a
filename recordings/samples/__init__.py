"""Sample floors that stopgo contains, drawn by the project itself."""
